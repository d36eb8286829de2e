"""Hangs all links up anew, after variables and links have other numbers."""

from ...core.kernels.compiled import compiled
from ..smoothing._graph import LINK, LINKS, VARIABLES, Graph
from ..smoothing._log import hang


@compiled
def rehang(g: Graph) -> None:
    """Makes the lists of links of all poses, the newest link first."""
    for v in range(g.state[VARIABLES]):
        g.variables[v, LINK] = -1
    for k in range(g.state[LINKS]):
        hang(g, k)
