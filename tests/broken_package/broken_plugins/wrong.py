"""Plug-ins of the wrong shape, and one with a name of ours."""

SHAPE = "of water"


class Shapeless:
    """Has nothing that any kind asks for."""

    name = "wrong_shape"


class Polite:
    """An agent, under a name that is taken."""

    def predict(self, instruction, obs):
        """Nothing."""
        return "After you.", ["DONE"]
