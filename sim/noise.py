"""Random numbers by address: the same question always gets the same answer.

A number is addressed by (seed, part, member, step); no generator is carried along. Member 7 of a
batch of 64, alone, after a restart or on another machine therefore draws the same numbers.
"""

from dataclasses import dataclass, field

import numpy as np

#: Fixed integer of each part that draws; part of the address, so never renumbered.
PARTS = {"bonds": 1, "shear": 2, "drive": 3, "contact": 4}

#: Most numbers that one noise block may hold for one member.
BLOCK_NUMBERS = 2**15


def steps_per_block(count: int) -> int:
    """Steps in one noise block when each step needs ``count`` numbers: a power of two.

    A function of the count alone, never of batch, memory or recording: it is part of the address.
    """
    return 2 ** max(0, (BLOCK_NUMBERS // max(count, 1)).bit_length() - 1)


@dataclass(frozen=True)
class Noise:
    """The random numbers of one part for the members of one batch.

    Parameters
    ----------
    seed : int
        Seed of the run, 0 to 2**64 - 1.
    part : str
        Which part asks, a key of ``PARTS``.
    members : array of int, shape (members,)
        Absolute numbers of the members in this batch.

    Notes
    -----
    Each member's block comes from ``Philox(key=(seed, part), counter=(0, block, member, 0))``;
    step 0 is the draw of the start. The block in use is kept, which changes no answer.
    """

    seed: int
    part: str
    members: np.ndarray
    _kept: dict = field(default_factory=dict, repr=False, compare=False)

    def normals(self, step: int, count: int) -> np.ndarray:
        """Standard normals of one step, shape (members, count)."""
        return self._numbers("standard_normal", step, count)

    def uniforms(self, step: int, count: int) -> np.ndarray:
        """Uniform numbers in [0, 1) of one step, shape (members, count)."""
        return self._numbers("random", step, count)

    def _numbers(self, kind: str, step: int, count: int) -> np.ndarray:
        steps = steps_per_block(count)
        block, row = divmod(step, steps)
        kept_block, numbers = self._kept.get((kind, count), (None, None))
        if kept_block != block:
            if numbers is None:
                numbers = np.empty((len(self.members), steps, count))
            for into, member in zip(numbers, self.members, strict=True):
                getattr(self._generator(block, int(member)), kind)(out=into)
            self._kept[kind, count] = (block, numbers)
        return numbers[:, row]

    def _generator(self, block: int, member: int) -> np.random.Generator:
        key = np.array([self.seed, PARTS[self.part]], dtype=np.uint64)
        counter = np.array([0, block, member, 0], dtype=np.uint64)
        return np.random.Generator(np.random.Philox(key=key, counter=counter))
