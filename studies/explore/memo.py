"""Keep results between two changes of a control, and end work whose result nobody waits for any more."""

from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import Any, TypeVar

T = TypeVar("T")
_KEPT = 8  # results that are kept per stage: four light groups of two cameras


class Overtaken(Exception):
    """Nobody waits for this work any more: a newer request came, or the page was closed."""


def never_cancel() -> None:
    """Do nothing where other checks may raise `Overtaken`, so that the work always goes on."""


@dataclass(frozen=True)
class Memo:
    """The last results of each stage, each under a key of all that decides it.

    Attributes
    ----------
    check : callable
        Function that is called before each stage; raises `Overtaken` where nobody waits for the result.
    """

    check: Callable[[], None] = never_cancel
    stages: dict[str, OrderedDict[Hashable, Any]] = field(default_factory=dict)

    def of(self, stage: str, key: Hashable, make: Callable[..., T], *arguments: object) -> T:
        """Return the result kept under a key; if there is none, make it by calling ``make(*arguments)``."""
        kept = self.stages.setdefault(stage, OrderedDict())
        if key not in kept:
            self.check()
            self.keep(stage, key, make(*arguments))
        kept.move_to_end(key)
        result: T = kept[key]
        return result

    def keep(self, stage: str, key: Hashable, result: object) -> None:
        """Keep a result under a key; if there are more than `_KEPT`, forget the one that was unused for longest."""
        kept = self.stages.setdefault(stage, OrderedDict())
        kept[key] = result
        if len(kept) > _KEPT:
            kept.popitem(last=False)

    def kept(self, stage: str, key: Hashable) -> Any:
        """Return the result kept under a key; None where there is none."""
        return self.stages[stage].get(key) if stage in self.stages else None
