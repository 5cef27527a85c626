"""Rings of the next depth layer, computed by another thread while the plan cuts the layer above it.

Passes of a layer go no deeper than the layer, so they leave the stock above the next one as it is. Where something else
has cut it in between, ``toolpath.strategies.depth_layers.layer`` sees that and computes the rings anew. So the plan has
the same bytes with any number of threads.
"""

from __future__ import annotations

import math
from concurrent.futures import Future, ThreadPoolExecutor

import numba

from toolpath.stock.stock_map import StockMap
from toolpath.strategies.depth_layers import LayerArea, LayerRings, layer_rings, standing_above
from zones.reach.tip_field import TipField


class RingsAhead:
    """The rings of one layer at a time. A context; at its end the thread is waited for.

    field                : TipField
    allowance, side_step : mm, as in ``toolpath.strategies.depth_layers.layer``
    """

    def __init__(self, field: TipField, allowance: float, side_step: float) -> None:
        self._field, self._allowance, self._side_step = field, allowance, side_step
        # one thread of numba there: no two threads may enter its threading layer at once
        self._pool = ThreadPoolExecutor(1, "rings", initializer=numba.set_num_threads, initargs=(1,))
        self._begun: tuple[float, Future[LayerRings]] | None = None

    def __enter__(self) -> RingsAhead:
        return self

    def __exit__(self, *_: object) -> None:
        self._pool.shutdown(cancel_futures=True)

    def begin(self, z: float, place: LayerArea, stock: StockMap) -> None:
        """Let the other thread begin with the layer at z, mm. ``stock`` may be cut above that height meanwhile.

        Nothing begins where numba may use one thread.
        """
        if numba.get_num_threads() > 1:
            standing = standing_above(self._field, stock, z)
            self._begun = z, self._pool.submit(layer_rings, self._field, z, place, standing, self._allowance,
                                               self._side_step)

    def of(self, z: float) -> LayerRings | None:
        """The rings of the layer at z, mm; None where they were not begun. Raises what computing them raises."""
        at, begun = self._begun or (math.nan, None)
        return begun.result() if begun is not None and at == z else None


__all__ = ["RingsAhead"]
