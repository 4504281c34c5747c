"""Which nodes of a scene are the joints of a body, and how many bodies its skins move."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

from motionlake.errors import ClipError
from motionlake.formats.limits_config import limits
from motionlake.motion.clip import depth_first

FEWEST_JOINTS: Final = 5  # beside a body: props such as a flag or a weapon have fewer


@dataclass(frozen=True)
class JointTree:
    """Which nodes of a scene are a body's joints.

    Attributes:
        nodes: indices of the nodes, parents first, from those above the joints on; -1 is the scene itself.
        parents: for each its parent's place in `nodes`; -1 at the first.
        root: the place at which the joints begin.
    """

    nodes: tuple[int, ...]
    parents: tuple[int, ...]
    root: int

    @property
    def joints(self) -> tuple[int, ...]:
        """Indices of the nodes that are joints."""
        return self.nodes[self.root :]

    @property
    def joint_parents(self) -> tuple[int, ...]:
        """For each joint its parent among the joints; -1 at the first."""
        return (-1, *(parent - self.root for parent in self.parents[self.root + 1 :]))


def joint_tree(parents: Sequence[int], wanted: Iterable[int]) -> JointTree:
    """The smallest tree with the wanted nodes in it: they, what is between them, and what is above.

    Args:
        parents: for each node of the scene its parent; -1 at the top.
        wanted: indices of nodes, one at least.

    Raises:
        ClipError: nodes that are below themselves, or more of them than `limits` allow.
    """
    chosen = set(wanted)
    order = depth_first(parents)
    marked = set()
    for node in reversed(order):  # children before parents
        if node in chosen or node in marked:
            marked.add(node)
            marked.add(parents[node])
    if not chosen <= marked:
        raise ClipError("has joints that are below themselves")
    nodes = [-1, *(node for node in order if node in marked)]
    limits().check("joints", len(nodes) - 1, f"has {len(nodes) - 1} joints")
    place = {node: index for index, node in enumerate(nodes)}
    above = [-1, *(place[parents[node]] for node in nodes[1:])]
    root = 0
    while nodes[root] not in chosen and above.count(root) == 1:
        root += 1  # depth first: an only child comes next
    return JointTree(tuple(nodes), tuple(above), root)


def body_trees(parents: Sequence[int], skins: Sequence[Iterable[int]]) -> list[JointTree]:
    """The bodies that several skins move: skins whose joints hang from one root are one body's.

    Where there is a body, what has fewer than `FEWEST_JOINTS` joints is none.
    """
    groups: dict[int, set[int]] = {}
    for joints in _sharing(skins):
        limits().check("bodies", len(groups), f"holds {len(groups)} skeletons")
        tree = joint_tree(parents, joints)
        above = set(tree.nodes[: tree.root + 1])
        here = tree.nodes[tree.root]
        akin = [root for root in groups if root in above or _is_below(parents, root, here)]
        for root in akin:
            joints |= groups.pop(root)
        groups[here if not akin else min((here, *akin), key=lambda node: _depth(parents, node))] = joints
    trees = [joint_tree(parents, joints) for joints in groups.values()]
    bodies = [tree for tree in trees if len(tree.joints) >= FEWEST_JOINTS]
    return bodies or trees


def _sharing(skins: Sequence[Iterable[int]]) -> list[set[int]]:
    """Sets of joints, those that share one made one."""
    found: list[set[int]] = []
    for skin in sorted({frozenset(skin) for skin in skins}, key=sorted):
        joints = set(skin)
        apart = [each for each in found if not each & joints]
        joints = joints.union(*(each for each in found if each & joints))
        found = [*apart, joints]
    return found


def _depth(parents: Sequence[int], node: int) -> int:
    depth = 0
    while node >= 0:
        node, depth = parents[node], depth + 1
    return depth


def _is_below(parents: Sequence[int], node: int, top: int) -> bool:
    while node != top and node >= 0:
        node = parents[node]
    return node == top
