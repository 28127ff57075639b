"""stiction.jax.solve over eight devices of one host: nothing is gathered, and the bits are those of one device."""

import json
import os
import subprocess
import sys
import textwrap

import pytest
from frameworks import framework

jax = framework("jax", "sharded solves are")
if not __import__("stiction.jax", fromlist=["uses_ffi"]).uses_ffi:
    pytest.skip("sharded solves are NOT tested, the package was built without JAX, or with one before 0.8.2: "
                "scripts/test.sh --frameworks",
                allow_module_level=True)

PROGRAM = textwrap.dedent("""
    import json
    import sys
    import jax
    import jax.numpy as jnp
    import numpy as np
    from jax.sharding import Mesh, NamedSharding, PartitionSpec
    import stiction.jax

    draw = np.random.default_rng(0)
    G = draw.standard_normal((64, 6, 6)).astype(np.float32)
    A = G @ G.transpose(0, 2, 1) + 0.1 * np.eye(6, dtype=np.float32)
    b = draw.standard_normal((64, 6)).astype(np.float32)
    mu = np.float32(draw.uniform(0.2, 1, (64, 6)))
    by_env = NamedSharding(Mesh(np.array(jax.devices()), ("env",)), PartitionSpec("env"))
    numbers = [jax.device_put(array, by_env) for array in (A, b, mu)]
    grouped = [array.reshape(8, 8, *array.shape[1:]) for array in (A, b, mu)]

    def answer(A, b, mu, **how):
        return stiction.jax.solve(A, b, mu, law="coulomb", **how)[:2]

    def gradient_of(**how):
        return lambda A, b, mu: jax.grad(lambda A, b: jnp.sum(answer(A, b, mu, **how)[0] ** 2), (0, 1))(A, b)

    gradient, relaxed = gradient_of(), gradient_of(kappa=0.01)
    unrolled = gradient_of(solver="pgs", tolerance=0.0, max_iterations=5, derivative="unrolled")

    def looks(function, arguments, plain, name="solve"):
        compiled = jax.jit(function).lower(*arguments).compile()
        text, out = compiled.as_text(), compiled(*arguments)
        gathers = any(name in text for name in ("all-gather", "all-reduce", "all-to-all", "collective-permute"))
        return {"gathers": gathers, "calls": text.count(f"stiction_{name}"),
                "callbacks": text.count("callback"),
                "stays": all(not one.sharding.is_fully_replicated for one in jax.tree.leaves(out)),
                "same": all(np.array_equal(one, np.reshape(other, one.shape))
                            for one, other in zip(jax.tree.leaves(out), jax.tree.leaves(plain)))}

    plain = answer(A, b, mu)
    mapped = jax.shard_map(answer, mesh=by_env.mesh, in_specs=PartitionSpec("env"), out_specs=PartitionSpec("env"))
    print(json.dumps({
        "devices": len(jax.devices()),
        "jit": looks(answer, numbers, plain),
        "vmap": looks(jax.vmap(answer), numbers, plain),
        "shard_map": looks(mapped, numbers, plain),
        "grad": looks(gradient, numbers, jax.jit(gradient)(A, b, mu)),
        "relaxed": looks(relaxed, numbers, jax.jit(relaxed)(A, b, mu), "relaxed_vjp"),
        "sweeps": looks(unrolled, numbers, jax.jit(unrolled)(A, b, mu), "sweep_vjp"),
        "two axes": looks(answer, [jax.device_put(array, by_env) for array in grouped], plain),
        "rows": bool(np.array_equal(answer(*[jax.device_put(array[:8], NamedSharding(by_env.mesh, PartitionSpec(None)))
                                             for array in (A, b, mu)])[0], plain[0][:8])),
        "one": bool(np.array_equal(answer(A[0], b[0], mu[0])[0], plain[0][0])),
    }))
""")


@pytest.fixture(scope="module")
def seen():
    flags = "--xla_force_host_platform_device_count=8"
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, timeout=200,
                          env=os.environ | {"XLA_FLAGS": flags, "JAX_PLATFORMS": "cpu",
                                            "PYTHONPATH": os.pathsep.join(sys.path)}, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def test_eight_devices_are_there(seen):
    assert seen["devices"] == 8


@pytest.mark.parametrize("how", ["jit", "vmap", "shard_map", "grad", "relaxed", "sweeps", "two axes"])
def test_each_device_solves_what_it_has(seen, how):
    looks = seen[how]
    assert looks["calls"] >= 1 and looks["callbacks"] == 0 and not looks["gathers"], looks
    assert looks["stays"] and looks["same"], looks


def test_arrays_that_are_not_sharded_are_solved_too(seen):
    assert seen["rows"] and seen["one"]
