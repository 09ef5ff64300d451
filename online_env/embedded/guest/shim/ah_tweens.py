"""Easing functions by pyautogui's names (Robert Penner's equations).

Each maps the share of time in 0..1 to the share of way.
"""

import math

FADE = 10  # how fast exponential ones rise
PERIOD = 0.3  # of elastic ones
OVERSHOOT = 1.70158  # of those that go back first
GRAVITY = 7.5625  # of bouncing ones
# Each bounce: its end, its middle (in parts of BOUNCES), its height.
BOUNCES = 2.75
HOPS = ((1, 0, 0), (2, 1.5, 0.75), (2.5, 2.25, 0.9375), (2.75, 2.625, 0.984375))


def linear(n):
    """Equal speed."""
    return n


def _in_out(ease):
    def both(n):
        if n < 0.5:
            return ease(2 * n) / 2
        return 1 - ease(2 - 2 * n) / 2

    return both


def _out(ease):
    def mirrored(n):
        return 1 - ease(1 - n)

    return mirrored


def _quad(n):
    return n**2


def _cubic(n):
    return n**3


def _quart(n):
    return n**4


def _quint(n):
    return n**5


def _sine(n):
    return 1 - math.cos(n * math.pi / 2)


def _circ(n):
    return 1 - math.sqrt(max(0.0, 1 - n * n))


def _back(n):
    return n * n * ((OVERSHOOT + 1) * n - OVERSHOOT)


def _expo(n):
    if n == 0:
        return 0.0
    return 2 ** (FADE * (n - 1))


def _elastic(n):
    if n in (0, 1):
        return n
    swing = math.sin((n - 1.075) * 2 * math.pi / PERIOD)
    return -(2 ** (FADE * (n - 1))) * swing


def _bounce_out(n):
    for end, middle, base in HOPS:
        if n <= end / BOUNCES:
            return GRAVITY * (n - middle / BOUNCES) ** 2 + base
    return 1.0


_KINDS = {
    "Quad": _quad,
    "Cubic": _cubic,
    "Quart": _quart,
    "Quint": _quint,
    "Sine": _sine,
    "Expo": _expo,
    "Circ": _circ,
    "Elastic": _elastic,
    "Back": _back,
    "Bounce": _out(_bounce_out),
}
TWEENS = {}
for _name, _ease in _KINDS.items():
    TWEENS[f"easeIn{_name}"] = _ease
    TWEENS[f"easeOut{_name}"] = _out(_ease)
    TWEENS[f"easeInOut{_name}"] = _in_out(_ease)
