"""What is said of the Cramér-Rao bound of a dataset's logs."""

from judged_rows import told
from slamduel.bench.verdict.bound_words import bound_sentence
from slamduel.bench.verdict.summary import lines


def test_the_bound_is_a_mean_of_squares_and_the_nearest_is_named() -> None:
    near = told("ekf", ate_m=[0.3, 0.4], bound_m=[0.3, 0.4], over_bound=[1.0, 1.0])
    far = told("ukf", ate_m=[0.3, 0.8], bound_m=[0.3, 0.4], over_bound=[1.0, 2.0])
    batch = told("graph", final_ate_m=[0.2, 0.2], final_bound_m=[0.1, 0.1], final_over_bound=[2.0, 2.0])
    assert bound_sentence(lines([*far, *near, *batch])) == (
        "No unbiased estimator ends below 0.100 m (final) or 0.354 m (online) with noise as stated: the Cramér-Rao "
        "bound, root mean square over 2 logs. Nearest: graph at 2.00 times the final one, ekf at 1.00 times the "
        "online one."
    )


def test_one_that_fails_is_not_the_nearest() -> None:
    failing = told("ekf", status=["done", "diverged"], bound_m=[0.3, None], over_bound=[1.0, None])
    other = told("ukf", bound_m=[0.3, 0.3], over_bound=[2.0, 2.0])
    assert "Nearest: ukf" in bound_sentence(lines([*failing, *other]))
    assert "Nearest" not in bound_sentence(lines(failing))


def test_of_logs_without_a_known_path_none_is_counted_and_less_than_the_bound_is_explained() -> None:
    some = told("ekf", ate_m=[0.2, 0.2, 0.2], bound_m=[0.4, 0.4, None], over_bound=[0.5, 0.5, None])
    said = bound_sentence(lines(some))
    assert "root mean square over 2 logs" in said
    assert said.endswith(
        "ekf at 0.500 times the online one. Below 1 is chance on these logs, or a bias that makes an error smaller."
    )


def test_the_reasons_of_a_missing_bound_are_said_once() -> None:
    places, start = "the landmarks' places are unknown", "the robot's start is unknown"
    ekf = told("ekf", ate_m=[0.3, 0.4, 0.3], no_bound=[places, start, places])
    ukf = told("ukf", ate_m=[0.3, 0.4, 0.3], no_bound=[places, start, places])
    assert bound_sentence(lines([*ekf, *ukf])) == f"No Cramér-Rao bound: {places}; {start}."
    some = told("ekf", ate_m=[0.3, 0.4], bound_m=[0.2, None], over_bound=[1.5, None], no_bound=[None, places])
    assert bound_sentence(lines(some)).startswith("No unbiased estimator ends below 0.200 m (online)")


def test_nothing_is_said_without_a_bound() -> None:
    assert bound_sentence(lines(told("ekf", ate_m=[0.3, 0.4]))) == ""
