"""Drives hand over the exact slip of each step."""

from numpy.testing import assert_allclose

from sim.parts.drive import Ramp, Start, Steady, Table


def test_ramps_count_the_path_of_both_directions_and_tables_jump_between_steps():
    motion = Ramp(start=-1.0, stop=3.0).motion(1, 0.0, 4.0, 4.0)
    assert_allclose([motion.slip[0], motion.path[0]], [4.0, 5.0], rtol=1e-15)
    steady = Steady(speed=2e-3).motion(1, 0.1, 0.7, 1.0)
    ramps = (Ramp(start=2e-3, stop=2e-3, scale=scale) for scale in ("linear", "log"))
    for drive in (*ramps, Table(time=(0.0, 0.5, 1.0), speed=(2e-3,) * 3)):
        motion = drive.motion(1, 0.1, 0.7, 1.0)
        assert_allclose(
            *([one.slip[0], one.path[0], one.speed[0]] for one in (motion, steady)),
            rtol=1e-14,
        )
    table = Table(time=(0.0, 1.0, 1.0, 2.0), speed=(1.0, 1.0, 5.0, 5.0))
    before, after = table.motion(1, 0.5, 1.0, 2.0), table.motion(2, 1.0, 1.5, 2.0)
    assert_allclose([before.slip[0], after.slip[0]], [0.5, 2.5], rtol=1e-15)
    assert_allclose([before.speed[0], after.speed[0]], [1.0, 5.0], rtol=1e-15)


def test_a_start_rests_and_slides_at_once():
    start = Start(rest=0.5, speed=-3.0)
    before, within, after = (
        start.motion(1, a, b, 2.0) for a, b in ((0.1, 0.4), (0.3, 1.0), (1.0, 2.0))
    )
    assert [part.slip[0] for part in (before, within, after)] == [0.0, -1.5, -3.0]
    assert [part.path[0] for part in (before, within, after)] == [0.0, 1.5, 3.0]
    ends = [(part.first[0], part.speed[0]) for part in (before, within, after)]
    assert ends == [(0.0, 0.0), (0.0, -3.0), (-3.0, -3.0)]
    # 0.3 of a run is 3 of 10 steps but for rounding: not a bit of sliding comes before it
    start, times = Start(rest=0.3, speed=1.0), [k * 0.1 for k in range(11)]
    assert times[3] != 0.3
    steps = [start.motion(k + 1, times[k], times[k + 1], 1.0) for k in range(10)]
    assert [step.speed[0] for step in steps] == [0.0] * 3 + [1.0] * 7
    assert steps[2].slip[0] == 0.0 and steps[3].first[0] == 1.0
    assert_allclose(steps[3].slip, 0.1, rtol=1e-14)
    moving, still = (
        Start(rest=rest, speed=2e-3).motion(1, 0.0, 5.0, 10.0) for rest in (0.0, 20.0)
    )
    steady = Steady(speed=2e-3).motion(1, 0.0, 5.0, 10.0)
    assert [moving.slip[0], moving.first[0]] == [steady.slip[0], steady.first[0]]
    assert [still.slip[0], still.path[0], still.first[0], still.speed[0]] == [0.0] * 4
