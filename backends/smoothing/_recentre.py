"""Moving the last pose to its estimate just before it is eliminated, so that its factors are linearised there.

It was put where the motion before it led from the estimate of that time, and what was sighted from it has moved it
since. All factors of a variable have to be linearised at one place: with two, information appears along directions that
nothing observes, as in an EKF (Huang, Mourikis and Roumeliotis, IJRR 29(5), 2010). So the clique of the pose before,
which has the motion between the two, is eliminated once more.
"""

from ...frontend.compiled import compiled
from .._models import wrap
from ._graph import (
    CHILD,
    ENOUGH,
    FRONT,
    FRONTALS,
    LAST,
    LATEST,
    LINK,
    LISTED,
    MEMBERS,
    NEAR,
    NEXT,
    NEXT_A,
    NEXT_B,
    POINT,
    STEP,
    TODO,
    A,
    Graph,
)  # fmt: skip
from ._links import relink


@compiled
def knows(g: Graph, c: int, v: int) -> bool:
    """Whether variable `v` is a separator of clique `c`."""
    q = g.cliques[c]
    found = False
    for t in range(q[LISTED] + q[FRONTALS], q[LISTED] + q[MEMBERS]):
        found = found or g.ints[t] == v
    return found


@compiled
def recentre(g: Graph) -> bool:
    """Linearise the last pose at its estimate, where it is off by enough and one small clique knows it.

    False where a link's covariance is not positive definite.
    """
    v, c = g.state[LAST], g.state[NEAR]
    off = 0.0
    for i in range(3):
        d = g.settings[LATEST + i] - g.values[v, i]
        off = max(off, abs(d if i < 2 else wrap(d)))
    if off <= g.settings[ENOUGH]:
        return True
    if c == 0 or g.cliques[c, NEXT] > 0 or g.cliques[c, FRONT] > 3:
        return True
    child = g.cliques[c, CHILD]
    while child > 0:
        if knows(g, child, v):
            return True
        child = g.cliques[child, NEXT]
    for i in range(3):
        g.values[v, i] = g.steps[g.variables[v, STEP], POINT + i] = g.settings[LATEST + i]
    k = g.variables[v, LINK]
    while k >= 0:
        if not relink(g, k):
            return False
        k = g.links[k, NEXT_A] if g.links[k, A] == v else g.links[k, NEXT_B]
    g.todo[g.state[TODO]] = c
    g.state[TODO] += 1
    return True
