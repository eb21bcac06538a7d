"""Points of a sweep in words, with their number."""

from helpers.scenes import scene

from sim.ensemble.plan import Plan
from sim.ensemble.swept import grouped, in_words, places, points_in_words
from sim.scenario.scenario import read_sweep

LOADS = ["1 mN", "2 mN", "4 mN", "8 mN"]


def plan(sweep):
    return Plan.of(scene(sweep=read_sweep(sweep)))


def test_a_statement_on_all_points_names_none():
    swept = plan({"contact.load": LOADS})
    assert points_in_words(swept, [0, 1, 2, 3], [0, 1, 2, 3]) == ""
    assert points_in_words(Plan.of(scene()), [0], [0]) == ""


def test_points_that_follow_one_another_are_a_range_and_others_a_list():
    swept = plan({"contact.load": LOADS})
    every = [0, 1, 2, 3]
    for chosen, words in (
        ([2], "at contact.load = 4 mN, 1 of 4 points"),
        ([0, 1], "at contact.load = 1 mN and 2 mN, 2 of 4 points"),
        ([1, 2, 3], "at contact.load = 2 mN to 8 mN, 3 of 4 points"),
        ([0, 2, 3], "at contact.load = 1 mN, 4 mN and 8 mN, 3 of 4 points"),
    ):
        assert points_in_words(swept, chosen, every) == words


def test_a_key_that_does_not_matter_is_left_out_and_no_point_is_named_that_is_not_meant():
    swept = plan({"contact.load": LOADS, "drive.speed": ["1 mm/s", "2 mm/s", "3 mm/s"]})
    every = [*range(12)]
    of_load, of_speed, of_both = [3, 4, 5], [2, 5, 8, 11], [1, 4]
    for chosen, words in (
        (of_load, "at contact.load = 2 mN, 3 of 12 points"),
        (of_speed, "at drive.speed = 3 mm/s, 4 of 12 points"),
        (
            of_both,
            "at contact.load = 1 mN and 2 mN, drive.speed = 2 mm/s, 2 of 12 points",
        ),
        (
            [0, 4],
            "at 2 of 12 points, such as contact.load = 1 mN, drive.speed = 1 mm/s",
        ),
    ):
        assert points_in_words(swept, chosen, every) == words


def test_points_that_were_not_examined_are_counted():
    swept = plan({"contact.load": {"from": "1 mN", "to": "50 mN", "count": 50}})
    examined = places(50, 3)
    assert (examined[0], examined[-1], len(examined)) == (0, 49, 3)
    text = points_in_words(swept, examined, examined)
    assert text == "at 3 of 3 points examined of 50"
    text = points_in_words(swept, [49], examined)
    assert text == "at contact.load = 50 mN, 1 of 3 points examined of 50"


def test_a_table_goes_by_its_model_and_zipped_keys_go_together():
    swept = plan(
        {"bonds": [{"model": "none"}, {"model": "steady", "critical_speed": 0.01}]}
    )
    assert points_in_words(swept, [1], [0, 1]) == "at bonds = steady, 1 of 2 points"
    swept = plan(
        [
            {"contact.load": "1 mN", "drive.speed": "1 mm/s"},
            {"contact.load": "2 mN", "drive.speed": "3 mm/s"},
        ]
    )
    text = "at contact.load = 2 mN, drive.speed = 3 mm/s, 1 of 2 points"
    assert points_in_words(swept, [1], [0, 1]) == text
    assert in_words(swept, swept.points[1], 3e-3) == "contact.load = 2 mN, 3 mm/s"
    assert in_words(swept, swept.points[0], 0.0) == "contact.load = 1 mN, rest"


def test_statements_that_differ_in_values_are_one_with_their_range_and_points():
    swept = plan({"contact.load": LOADS})

    def heavy(point):
        load = 1e3 * point.contact.load
        return [f"weighs {load:g} mN: give 0.5 of it"] if load > 1.5 else ["is light"]

    assert grouped(swept, [0, 1, 2, 3], heavy) == [
        "is light (at contact.load = 1 mN, 1 of 4 points)",
        "weighs 2 mN to 8 mN: give 0.5 of it (at contact.load = 2 mN to 8 mN, 3 of 4 points)",
    ]
