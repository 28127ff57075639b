"""Calls from JAX into the library. On the CPU they are XLA custom calls (jax.ffi) where the package was built beside
JAX, of 0.8.2 or later. On other platforms, or if it was not, they are host callbacks (jax.pure_callback). Both have the same bits.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
from jax.experimental.custom_partitioning import custom_partitioning
from jax.sharding import NamedSharding, PartitionSpec

from .. import _core
from ..core.arrays import STATUS_DTYPE
from ..core.layout import cone_list, tiles
from . import host

#: True if calls on the CPU are XLA custom calls. JAX before 0.8.2 cannot shard them.
uses_ffi = bool(_core.jax_calls) and jax.__version_info__ >= (0, 8, 2)
for _name, _handler in _core.jax_calls.items() if uses_ffi else ():
    jax.ffi.register_ffi_target(f"stiction_{_name}", _handler, platform="cpu")

_MATRIX, _ROWS, _RECORDS = "... i j", "... i", "... k"
_NUMBERS = (_MATRIX,) + 5 * (_ROWS,)  # A, b, mu, R, lo, hi
_ANSWER = (_ROWS, _ROWS, _RECORDS)
#: Axes of arguments and results of each function of `host`.
_AXES = {"solve": (_NUMBERS, _ANSWER),
         "sweep": ((*_NUMBERS, _ROWS), _ANSWER),
         "relaxed_vjp": ((*_NUMBERS, _ROWS, _RECORDS, _ROWS, _ROWS), _NUMBERS),
         "sweep_vjp": ((*_NUMBERS, _ROWS, _ROWS, _ROWS), (*_NUMBERS, _ROWS))}


def _by_environments(call, takes, gives):
    """`call`, such that leading axes may be sharded and vmapped. Rows stay together. takes, gives: axes of its
    arguments and results.
    """

    def partition(mesh, arguments, results):
        lead = tuple(arguments[1].sharding.spec)[:len(arguments[1].shape) - 1]
        by_lead = NamedSharding(mesh, PartitionSpec(*lead))
        return mesh, call, (by_lead,) * len(results), (by_lead,) * len(arguments)

    rule = f"{', '.join(takes)} -> {', '.join(gives)}"
    sharded = custom_partitioning(call)
    sharded.def_partition(partition=partition, sharding_rule=rule,
                          need_replication_factors=tuple(axis for axis in "ijk" if axis in rule))

    @jax.custom_batching.custom_vmap
    def batched(*arguments):
        return sharded(*arguments)

    @batched.def_vmap
    def _(size, is_batched, *arguments):
        wide = [x if has else jnp.broadcast_to(x, (size, *x.shape)) for x, has in zip(arguments, is_batched)]
        return batched(*wide), (True,) * len(gives)

    return batched


def cones_of(given, rows):
    """(kinds, dims) of one environment's cones, which are all of its rows."""
    kinds, dims = cone_list("cones", given, rows)
    tiles("cones", dims, rows)
    return kinds, dims


def _shapes(gives, A, b):
    """Shapes of results with those axes, for the problems A and b."""
    shapes = {_MATRIX: jax.ShapeDtypeStruct(A.shape, A.dtype), _ROWS: jax.ShapeDtypeStruct(b.shape, A.dtype),
              _RECORDS: jax.ShapeDtypeStruct(b.shape[:-1] + (STATUS_DTYPE.itemsize,), jnp.uint8)}
    return tuple(shapes[axes] for axes in gives)


@functools.partial(jax.custom_jvp, nondiff_argnums=(0, 1))
def run(name, how, *arguments):
    """Results of that function of `host`. arguments: the numbers A, b, mu, R, lo, hi, then its own."""
    takes, gives = _AXES[name]
    kinds, dims = cones_of(how.cones, arguments[1].shape[-1])

    def call_back(*arguments):
        function = functools.partial(getattr(host, name), how)
        return jax.pure_callback(function, _shapes(gives, *arguments[:2]), *arguments, vmap_method="broadcast_all")

    if not (uses_ffi and how.allow_ffi):
        return call_back(*arguments)

    def custom_call(*arguments):
        call = jax.ffi.ffi_call(f"stiction_{name}", _shapes(gives, *arguments[:2]), vmap_method="broadcast_all")
        return call(*arguments, kinds=kinds.astype(np.int64), dims=dims, law=how.law, solver=how.solver,
                    tolerance=np.float64(how.tolerance), max_iterations=np.int64(how.max_iterations),
                    kappa=np.float64(how.kappa))

    return jax.lax.platform_dependent(*arguments, cpu=_by_environments(custom_call, takes, gives), default=call_back)


@run.defjvp
def _(name, how, arguments, changes):
    option = f"kappa={how.kappa}" if how.kappa else "derivative='unrolled'"
    raise ValueError(f"{option}: expected one derivative, in reverse, got a further one: use kappa=0 and "
                     "derivative='implicit' for it")
