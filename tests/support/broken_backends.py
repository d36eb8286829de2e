"""A sound backend, and a broken one per fault, with the check that must detect it and its message."""

from typing import Any, ClassVar

import numpy as np

from slamduel.backends.api import Belief, Diverged, Map, Odometry, Pose, Prior, RangeBearing, Solution, Step
from slamduel.backends.programs.textbook_ekf import TextbookEkf
from slamduel.core.se2 import Array


class Sound:
    """The textbook's filter as a backend; the classes below each break one thing."""

    def __init__(self, prior: Prior, options: Any, rng: np.random.Generator) -> None:
        self.prior, self.options, self.rng, self.k = prior, options, rng, -1
        self.ekf, self.path = TextbookEkf(self.given(prior)), list[Array]()

    def given(self, prior: Prior) -> Prior:
        return prior

    def step(self, step: Step) -> Pose | None:
        self.k += 1
        return self.ekf.step(step)

    def belief(self) -> Belief | None:
        nis = self.ekf.nis if self.ekf.nis_dof else None
        return Belief(self.ekf.mean[:3].copy(), self.ekf.cov[:3, :3].copy(), nis, self.ekf.nis_dof)

    def map(self) -> Map:
        cov = self.ekf.cov[3:, 3:].copy()
        xy = self.ekf.mean[3:].reshape(-1, 2).copy()
        return Map(np.array(self.ekf.ids, np.int64), xy, cov if cov.any() else None)

    def finish(self) -> Solution | None:
        return None


class SharesItsMap(Sound):
    """Keeps its state in the class."""

    shared: ClassVar[list[TextbookEkf]] = []

    def __init__(self, prior: Prior, options: Any, rng: np.random.Generator) -> None:
        super().__init__(prior, options, rng)
        self.shared[:] = [self.ekf]

    def step(self, step: Step) -> Pose | None:
        return self.shared[0].step(step)


class MutatesItsInput(Sound):
    """Moves the prior in place, having made it writable."""

    def step(self, step: Step) -> Pose | None:
        self.prior.pose.flags.writeable = True
        self.prior.pose[0] += 0.1
        return super().step(step)


class ScalesItsInput(Sound):
    """Scales sightings in place, which read-only arrays refuse."""

    def step(self, step: Step) -> Pose | None:
        step.sightings.z[:, 0] *= 1.0
        return super().step(step)


class Unwrapped(Sound):
    """Does not wrap the heading."""

    turned = 0.0

    def step(self, step: Step) -> Pose | None:
        pose = self.ekf.step(step)
        while pose[2] < self.turned - np.pi:
            pose[2] += 2 * np.pi
        self.turned = pose[2]
        return pose


class UsesGlobalChance(Sound):
    """Draws from numpy's global state."""

    def step(self, step: Step) -> Pose | None:
        np.random.uniform()  # noqa: NPY002  that is what is wrong with it
        return super().step(step)


class DrawsInSecret(Sound):
    """Draws from its generator although its builder does not declare it."""

    def step(self, step: Step) -> Pose | None:
        self.rng.uniform()
        return super().step(step)


class DrawsFromTheClock(Sound):
    """Seeds a generator of its own from the system."""

    def step(self, step: Step) -> Pose | None:
        pose = self.ekf.step(step)
        return pose + 1e-12 * np.random.default_rng().uniform(size=3)


class BeliefChangesThePath(Sound):
    """Rounds its state when queried."""

    def belief(self) -> Belief | None:
        self.ekf.mean = np.round(self.ekf.mean, 12)
        return super().belief()


class ReusesItsAnswer(Sound):
    """Returns the array it continues to work in."""

    def step(self, step: Step) -> Pose | None:
        self.path = self.path or [np.zeros(3)]
        self.path[0][:] = self.ekf.step(step)
        return self.path[0]


class ForgetsThePrior(Sound):
    """Starts at the origin."""

    def given(self, prior: Prior) -> Prior:
        return prior._replace(pose=np.zeros(3))


class ForgetsTheMap(Sound):
    """Builds its own map although one was given."""

    def given(self, prior: Prior) -> Prior:
        return prior._replace(map=None)


class TakesTheMapForUncertain(Sound):
    """Moves the landmarks of a map that must be held fixed."""

    def given(self, prior: Prior) -> Prior:
        if prior.map is None or prior.map.cov is not None:
            return prior
        return prior._replace(map=prior.map._replace(cov=1e-4 * np.eye(2 * len(prior.map.ids))))


class WrongShape(Sound):
    """Returns a pose with a z."""

    def step(self, step: Step) -> Pose | None:
        return np.append(self.ekf.step(step), 0.0)


class SinglePrecision(Sound):
    """Returns float32."""

    def step(self, step: Step) -> Pose | None:
        return self.ekf.step(step).astype(np.float32)  # pyright: ignore[reportReturnType]


class TurnsIntoNan(Sound):
    """Returns NaN from step 20 on."""

    def step(self, step: Step) -> Pose | None:
        pose = super().step(step)
        return pose if self.k < 20 else np.full(3, np.nan)


class Raises(Sound):
    """Fails when a landmark is seen again."""

    def step(self, step: Step) -> Pose | None:
        if self.k > 3:
            raise ZeroDivisionError("no such gain")
        return super().step(step)


class SaysNothing(Sound):
    """Returns neither an online nor a final path."""

    def step(self, step: Step) -> Pose | None:
        self.ekf.step(step)
        return None


class Asymmetric(Sound):
    """Returns an invalid covariance."""

    def belief(self) -> Belief | None:
        return Belief(self.ekf.mean[:3].copy(), self.ekf.cov[:3, :3] + np.triu(np.full((3, 3), 1e-4), 1))


class Overconfident(Sound):
    """Returns zeros for an unknown covariance."""

    def belief(self) -> Belief | None:
        return Belief(self.ekf.mean[:3].copy(), np.zeros((3, 3)))


class MiscountsInnovations(Sound):
    """Counts new landmarks among its innovations."""

    def belief(self) -> Belief | None:
        return Belief(self.ekf.mean[:3].copy(), None, 0.0, self.ekf.nis_dof + 2)


class Narrow(Sound):
    """Keeps landmark ids in 32 bits."""

    def step(self, step: Step) -> Pose | None:
        ids = step.sightings.ids.astype(np.int32).astype(np.int64)
        return super().step(step._replace(sightings=step.sightings._replace(ids=ids)))


class Doubled(Sound):
    """Lists every landmark on its map twice."""

    def map(self) -> Map:
        ids, xy, _ = super().map()
        return Map(np.append(ids, ids), np.append(xy, xy, axis=0), None)


class Mirrored(Sound):
    """Builds its map with bearings to the right."""

    def map(self) -> Map:
        landmarks = super().map()
        return landmarks._replace(xy=landmarks.xy * [1, -1])


class UnwrappedInnovations(Sound):
    """Does not wrap innovations of bearings."""

    def step(self, step: Step) -> Pose | None:
        if step.odometry is not None:
            self.ekf.predict(step.odometry)
        for landmark, z, cov in zip(step.sightings.ids.tolist(), step.sightings.z, step.sightings.cov, strict=True):
            if landmark not in self.ekf.ids:
                self.ekf.add(landmark, z, cov)
                continue
            (expected, H), P = self.ekf.predict_sighting(landmark), self.ekf.cov
            K = P @ H.T @ np.linalg.inv(H @ P @ H.T + cov)
            self.ekf.mean = self.ekf.mean + K @ (z - expected)
            self.ekf.mean[2] = np.arctan2(np.sin(self.ekf.mean[2]), np.cos(self.ekf.mean[2]))
            self.ekf.cov = P - K @ H @ P
        return self.ekf.mean[:3].copy()


class Backwards(Sound):
    """Composes the motion in the world frame."""

    def step(self, step: Step) -> Pose | None:
        if step.odometry is not None:
            c, s = np.cos(self.ekf.mean[2]), np.sin(self.ekf.mean[2])
            (dx, dy, turn), cov = step.odometry
            step = step._replace(odometry=Odometry(np.array([c * dx - s * dy, s * dx + c * dy, turn]), cov))
        return super().step(step)


class Halting(Sound):
    """Does not move at steps without sightings."""

    def step(self, step: Step) -> Pose | None:
        return super().step(step if len(step.sightings.ids) else step._replace(odometry=None))


class DividesByDistance(Sound):
    """Normalises a motion of zero length."""

    def step(self, step: Step) -> Pose | None:
        if step.odometry is not None:
            delta, cov = step.odometry
            length = np.hypot(delta[0], delta[1])
            with np.errstate(invalid="ignore"):
                step = step._replace(odometry=Odometry(delta / length * length, cov))
        return super().step(step)


class ShortSolution(Sound):
    """Leaves step 0 out of its final path."""

    def step(self, step: Step) -> Pose | None:
        self.path.append(self.ekf.step(step))
        return self.path[-1].copy()

    def finish(self) -> Solution | None:
        return Solution(np.array(self.path[1:]), self.map())


class ConvergesPerhaps(ShortSolution):
    """Has a word for whether it converged."""

    def finish(self) -> Solution | None:
        return Solution(np.array(self.path), self.map(), None, "perhaps")  # pyright: ignore[reportArgumentType]


class Forgetful(ShortSolution):
    """Gives a final map with one landmark less."""

    def finish(self) -> Solution | None:
        ids, xy, _ = self.map()
        return Solution(np.array(self.path), Map(ids[1:], xy[1:], None))


class LostAtZeroRange(Sound):
    """Divides by a range."""

    def step(self, step: Step) -> Pose | None:
        pose = super().step(step)
        return np.full(3, np.nan) if (step.sightings.z[:, 0] < 1e-6).any() else pose


class SmallTable(Sound):
    """Looks landmarks up in a table of a million."""

    def step(self, step: Step) -> Pose | None:
        for landmark in step.sightings.ids.tolist():
            if landmark > 10**6:
                raise KeyError(landmark)
        return super().step(step)


class ShutsItsEyes(Sound):
    """Silently drops what does not fit."""

    def step(self, step: Step) -> Pose | None:
        ids, z, cov = step.sightings
        fits = ids < 2**16
        return super().step(step._replace(sightings=RangeBearing(ids[fits], z[fits], cov[fits])))


class GivesUp(Sound):
    """Diverges, whatever the log."""

    def step(self, step: Step) -> Pose | None:
        raise Diverged("the numbers looked odd")


class LosesItsMap(Sound):
    """Ends with a map that is not finite."""

    def map(self) -> Map:
        ids, xy, _ = super().map()
        return Map(ids, np.full_like(xy, np.inf), None)


class InTicks(Sound):
    """Treats the time as a number of ticks of 0.1 s, and keeps moving in between."""

    t = 0.0

    def step(self, step: Step) -> Pose | None:
        ticks, self.t = (step.t - self.t) / 0.1, step.t
        if step.odometry is not None:
            step = step._replace(odometry=Odometry(step.odometry.delta * ticks, step.odometry.cov))
        return super().step(step)


ADVERSE: list[tuple[type[Sound], str, str]] = [
    (LostAtZeroRange, "zero-range", "the online path is not finite from step 0 on"),
    (SmallTable, "huge-ids", f"it raised KeyError: {2**53} ({__file__}"),
    (ShutsItsEyes, "huge-ids", "the final map lacks 5 of 6 landmarks sighted, id 2147483647 for one"),
    (UnwrappedInnovations, "across-the-cut", "off at step"),
    (GivesUp, "one-step", "it gave up: the numbers looked odd; expected it done"),
    (LosesItsMap, "one-landmark", "map() has a xy that is not finite"),
    (InTicks, "uneven-time", "off at step"),
    (Halting, "no-sightings", "off at step"),
    (Backwards, "no-sightings", "off at step"),
    (DividesByDistance, "an-hour-in-the-dark", "not finite from step 1 on"),
]
"""Each with an adversarial log on which it must fail."""

BROKEN: list[tuple[type[Sound], str, str]] = [
    (SharesItsMap, "two-at-once-share-nothing", "differ from step"),
    (MutatesItsInput, "the-log-is-left-alone", "no longer what it was"),
    (ScalesItsInput, "answers-have-their-types", "it raised ValueError: output array is read-only"),
    (Unwrapped, "headings-are-wrapped", "expected it in (-pi, pi]"),
    (UsesGlobalChance, "chance-comes-from-its-generator", "global random state"),
    (DrawsInSecret, "chance-comes-from-its-generator", "random=True"),
    (DrawsFromTheClock, "the-same-seed-gives-the-same-path", "differ from step 0"),
    (BeliefChangesThePath, "asking-changes-nothing", "differ from step"),
    (ReusesItsAnswer, "answers-stay-as-given", "the pose of step 0 was changed"),
    (ForgetsThePrior, "it-starts-at-the-prior", "the online start is 3.61 m off at step 0"),
    (ForgetsTheMap, "a-given-map-is-used", "expected less than half"),
    (ForgetsTheMap, "an-uncertain-map-is-used", "expected less than half"),
    (TakesTheMapForUncertain, "a-given-map-is-used", "expected it held fixed"),
    (WrongShape, "answers-have-their-types", "float64 (4,), expected float64 (3,)"),
    (SinglePrecision, "answers-have-their-types", "float32 (3,), expected float64 (3,)"),
    (TurnsIntoNan, "answers-have-their-types", "step 20 is not finite"),
    (TurnsIntoNan, "an-exact-log-is-followed", "not finite from step 20 on"),
    (Raises, "an-exact-log-is-followed", "it raised ZeroDivisionError: no such gain (" + __file__),
    (SaysNothing, "answers-have-their-types", "neither step nor finish"),
    (Asymmetric, "covariances-are-covariances", "not symmetric"),
    (Overconfident, "covariances-are-covariances", "eigenvalue 0"),
    (MiscountsInnovations, "innovations-are-counted", "nis_dof is 2 at step 0 with 0 sightings, expected 0 to 0"),
    (Narrow, "the-map-holds-what-was-seen", "lacks ids [3000000000, 1000000000000]"),
    (Doubled, "the-map-holds-what-was-seen", "has a landmark twice"),
    (Mirrored, "landmarks-are-where-they-are", "m off, expected at most"),
    (UnwrappedInnovations, "innovations-are-wrapped", "m off at step"),
    (Backwards, "without-sightings-it-is-dead-reckoning", "m off at step 1"),
    (Halting, "it-goes-on-without-sightings", "m off at step"),
    (DividesByDistance, "standing-still-does-no-harm", "not finite from step 1 on"),
    (ShortSolution, "answers-have-their-types", "(89, 3), expected float64 (90, 3)"),
    (Forgetful, "answers-have-their-types", "different landmarks"),
    (Forgetful, "the-map-holds-what-was-seen", "lacks ids ["),
    (ConvergesPerhaps, "answers-have-their-types", "converged is 'perhaps', expected True, False or None"),
]
