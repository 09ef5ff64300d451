"""Training agents with corruptions: DA-GRPO (paper, section 5 and Algorithm 10).

`sampler` draws the corruption of each rollout, `rollouts` plays any gymnasium environment,
`objective` and `replay` are the algorithm, `trainer` is the loop, and `split` keeps training and
evaluation apart. Nothing is imported here: `split` works without torch.
"""
