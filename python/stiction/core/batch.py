"""Batches: many environments' contact problems over arrays that stay where they are."""

from __future__ import annotations

import os

import numpy as np

from .. import _core
from .arguments import each_count, each_not_negative, number, spread_over, whole
from .arrays import FLOATS, NUMPY, as_numpy, framework_of, look, take
from .batch_arrays import BatchArrays
from .body_rows import jacobian_arguments
from .jacobian_bodies import JacobianBodies
from .layout import Flat, Padded, offsets_of
from .lists import join_jacobians, join_matrices
from .policy import Accuracy


def _float_type(name, seen):
    if seen.dtype not in FLOATS:
        raise TypeError(f"{name}: expected float32 or float64, got {seen.dtype}")
    return seen.dtype


class Batch(BatchArrays):
    """Contact problems of many environments, made by one of the `from_` functions.

    Each environment has n rows tiled by cones. It seeks reactions lambda in the cones and residual motion w = (A +
    diag R) lambda + b, complementary to lambda by the cones' law. w has the unit of whatever motion the caller uses
    (m/s, m/s2), lambda the one that belongs to it (N s, N).

    Arrays of NumPy, PyTorch, JAX, CuPy and Warp are read in place, in float32 or float64. Change them in place between
    solves and the next solve sees it. Arrays that cannot be read in place raise TypeError (not an array, another
    dtype) or ValueError (shape, device, strides). The message names the argument, the expected and the given value.
    Lists, one entry per environment, are copied.

    Batches and their solutions can be pickled and copied deeply, with their arrays, where these can.

    Attributes: form ("delassus", "jacobian" or "bodies"), dtype ("float32" or "float64"), device ("cpu", "cuda:0"),
    law ("convex" or "coulomb"), arrays (the batch's arrays by argument name).
    """

    # -- making one ---------------------------------------------------------------------------------------------------

    @classmethod
    def from_delassus(cls, A, b, *, cones=None, kinds=None, dims=None, counts=None, cone_counts=None, offsets=None,
                      indptr=None, indices=None, mu=None, R=None, lo=None, hi=None, law: str = "convex", groups=None,
                      env_tolerance=None, env_max_iterations=None) -> Batch:
        """Delassus operators A = J M^-1 J' (without R) and right-hand sides b.

        Three ways to give environments; B environments, n rows, K cones:

        * padded: A (B, n, n), b (B, n). `counts` (B,) or `cone_counts` (B,), int32: rows or cones in use of each, read
          anew at every solve; none: all. Numbers behind the rows in use are not read.
        * lists: A one (n_e, n_e) array or SciPy CSR matrix per environment, b one (n_e,); copied.
        * flat: b (rows,), `offsets` (B + 1,) int64 the first row of each environment. A the dense matrices one after
          another (sum n_e^2,), or CSR values with `indptr` (rows + 1,) int64 and `indices` (nnz,) int32. Columns count
          from the environment's first row.

        cones: of every environment, a kind's name that tiles all rows, or a list of names and (name, rows) pairs. The
            kinds are "friction" (the default, by three rows), "box_friction" (likewise), "unilateral", "box" and "free".
            One more is "semidefinite", a matrix of order 2 or 3 in the 3 or 6 rows of semidefinite_vector(). With lists
            also one such list per environment. kinds, dims instead: uint8 numbers and rows of all cones, (B, K) padded and (K,)
            flat.
        mu: friction per axis [-; torsional and rolling: m], on rows after a friction cone's first: one number, one per
            row, or one per cone. R: compliance >= 0 [w / lambda]. lo, hi: bounds of box rows, from 1e20 on none [lambda].
            Like b in shape; None: zeros.
        law: "convex" or "coulomb". groups: int32 manifold of each cone, or None.
        env_tolerance float64 (B,), env_max_iterations int32 (B,): instead of the solver's. Read in place at every solve; a
            negative number, or NaN, is the solver's.
        """
        law = _law(law)
        accuracy = (env_tolerance, env_max_iterations)
        if isinstance(A, (list, tuple)):
            return cls._from_list(A, b, cones, mu, R, lo, hi, law, groups, accuracy)
        seen = look("A", A)
        self = cls("delassus", framework_of(A), _float_type("A", seen), seen.device, law)
        if offsets is None:
            if len(seen.shape) != 3 or seen.shape[1] != seen.shape[2]:
                take("A", A, self.dtype, ("environments", "rows", "rows"), self.device)
                raise ValueError(f"A: expected square matrices (environments, rows, rows), got {seen.shape}")
            env_count, room, _ = seen.shape
            self._numbers("A", A, (env_count, room, room))
            self.layout = Padded(env_count, room, self.device, self.framework, cones=cones, kinds=kinds, dims=dims,
                                 counts=counts, cone_counts=cone_counts)
            self.arrays.update(self.layout.counted())
            self._integers(self.layout.dense_blocks())
        else:
            self._flat_layout(offsets, cones, kinds, dims)
            if indptr is None:
                sizes = np.diff(self.layout.integers["env_row_offsets"]).astype(np.int64)
                self._numbers("A", A, (int((sizes * sizes).sum()),))
                self._integers(self.layout.dense_blocks())
            else:
                self._numbers("A", A, ("nonzeros",))
                entries = self._seen["A"].size
                self._given("row_offsets", "indptr", indptr, "int64", (self.layout.row_count + 1,))
                self._given("column", "indices", indices, "int32", (entries,))
        self._numbers("b", b, self.layout.row_shape)
        self._rows(mu, R, lo, hi, groups, accuracy)
        return self

    @classmethod
    def from_jacobian(cls, J, M, v_free, target=None, *, cones=None, kinds=None, dims=None, counts=None,
                      cone_counts=None, offsets=None, dof_offsets=None, indptr=None, indices=None, mass_block=None,
                      mass_form="matrix", mu=None, R=None, lo=None, hi=None, law="convex", groups=None,
                      env_tolerance=None, env_max_iterations=None) -> Batch:
        """Constraint Jacobians, mass matrices and velocities without contact. A = J M^-1 J', b = J v_free - target,
        and the velocities v = v_free + M^-1 J' lambda come with the solution. With accelerations in place of
        velocities, as MuJoCo has them, lambda is a force.

        J (B, n, nv) [w / v]; v_free (B, nv) [v]; target (B, n) [w], None: zeros. M (B, nv, nv) dense, (B, nv) diagonal
        or (B, nv / m, m, m) blocks [lambda w / v2], of which lower triangles are read. mass_form "factor": lower
        Cholesky factors instead. Lists: one array per environment, copied. Flat: J (sum n_e nv_e,), or CSR values with
        indptr int64 and indices int32. offsets and dof_offsets (B + 1,) int64, M (entries,) with mass_block, the rows
        of its blocks (0: one block per environment). All else as in from_delassus.
        """
        law = _law(law)
        if mass_form not in ("matrix", "factor"):
            raise ValueError(f"mass_form: expected 'matrix' or 'factor', got {mass_form!r}")
        accuracy = (env_tolerance, env_max_iterations)
        if isinstance(J, (list, tuple)):
            J, M, v_free, target, offsets, dof_offsets, mass_block, kinds, dims, mu, R, lo, hi, groups = join_jacobians(
                J, M, v_free, target, mass_block, cones, mu, R, lo, hi, groups)
            cones = None
        seen = look("J", J)
        self = cls("jacobian", framework_of(J), _float_type("J", seen), seen.device, law)
        self.factored = mass_form == "factor"
        if offsets is None:
            if len(seen.shape) != 3:
                take("J", J, self.dtype, ("environments", "rows", "dofs"), self.device)
            env_count, room, dofs = seen.shape
            self._numbers("J", J, (env_count, room, dofs))
            self.layout = Padded(env_count, room, self.device, self.framework, cones=cones, kinds=kinds, dims=dims,
                                 counts=counts, cone_counts=cone_counts)
            self.arrays.update(self.layout.counted())
            self.mass_block = self._mass(M, env_count, dofs)
            entries = dofs * (self.mass_block or dofs)
            self._integers({"row_offsets": np.arange(env_count * room + 1, dtype=np.int64) * dofs,
                            "env_dof_offsets": np.arange(env_count + 1, dtype=np.int64) * dofs,
                            "env_mass_offsets": np.arange(env_count + 1, dtype=np.int64) * entries})
            self.dof_shape = (env_count, dofs)
        else:
            self._flat_layout(offsets, cones, kinds, dims)
            self._flat_jacobian(J, M, dof_offsets, indptr, indices, mass_block)
        self._numbers("v_free", v_free, self.dof_shape)
        if target is not None:
            self._numbers("target", target, self.layout.row_shape)
        self._rows(mu, R, lo, hi, groups, accuracy)
        return self

    @classmethod
    def from_bodies(cls, inv_mass, inv_inertia, twist, body_a, body_b, arm_a, arm_b, normal, mu, depth,
                    restitution=None, *, twist_change=None, kinematic=None, body_offsets=None, contact_offsets=None,
                    law="coulomb", dt=0.005, erp=0.2, slop=0.0, cfm=0.0, restitution_threshold=0.1, substeps=1,
                    max_contacts_per_env: int = 0) -> Batch:
        """Rigid bodies and contact points, without a matrix (sequential impulses, or Newton's method).

        Either all environments have as many bodies and contacts, arrays (B, bodies, ...) and (B, contacts, ...). Or
        they follow one another, (bodies, ...) and (contacts, ...), with body_offsets and contact_offsets (B + 1,)
        int64.

        * inv_mass (...) [1/kg]; inv_inertia (..., 6): xx, xy, xz, yy, yz, zz about the centre of mass, in world axes
          [1/(kg m2)].
        * twist (..., 6): velocity [m/s] and spin [rad/s]; twist_change (..., 6): its change by all forces but contact
          over the step; kinematic (...) uint8.
        * body_a, body_b (...) int32, -1 the world; arm_a, arm_b (..., 3): contact point from the centres of mass [m].
        * normal (..., 3): unit, from a to b; mu (...) [-]; depth (...): penetration, negative: a gap [m]; restitution
          (...) in [0, 1].
        * dt: step [s]; erp: share of a penetration undone in a step; slop [m]; cfm [m/(N s)]; restitution_threshold
          [m/s].
        * law: "coulomb", "convex" or "boxed", of which the last is for sequential impulses alone
          (docs/math/box_friction.md).
        * substeps; max_contacts_per_env: the deepest are solved, 0: all.
        """
        seen = look("inv_mass", inv_mass)
        self = cls("bodies", framework_of(inv_mass), _float_type("inv_mass", seen), seen.device,
                   _law(law, ("convex", "coulomb", "boxed")))
        self.stepping = (number("dt", dt), number("erp", erp), number("slop", slop), number("cfm", cfm),
                         number("restitution_threshold", restitution_threshold), whole("substeps", substeps),
                         whole("max_contacts_per_env", max_contacts_per_env))
        if body_offsets is None:
            bodies = look("inv_mass", inv_mass).shape
            contacts = look("body_a", body_a).shape
            for name, shape in (("inv_mass", bodies), ("body_a", contacts)):
                if len(shape) != 2:
                    raise ValueError(f"{name}: expected (environments, {'bodies' if name == 'inv_mass' else 'contacts'}), "
                                     f"or body_offsets and contact_offsets, got {shape}")
            env_count = bodies[0]
            self._integers({"env_body_offsets": np.arange(env_count + 1, dtype=np.int64) * bodies[1],
                            "env_contact_offsets": np.arange(env_count + 1, dtype=np.int64) * contacts[1]})
        else:
            self._given("env_body_offsets", "body_offsets", body_offsets, "int64", ("environments + 1",))
            env_count = self._seen["env_body_offsets"].size - 1
            self._given("env_contact_offsets", "contact_offsets", contact_offsets, "int64", (env_count + 1,))
            bodies, contacts = ("bodies",), ("contacts",)
        self._env_count = env_count
        self._numbers("inv_mass", inv_mass, bodies)
        self.body_shape = tuple(self._seen["inv_mass"].shape)
        self._given("body_a", "body_a", body_a, "int32", contacts)
        self.contact_shape = tuple(self._seen["body_a"].shape)
        self._given("body_b", "body_b", body_b, "int32", self.contact_shape)
        self._numbers("inv_inertia", inv_inertia, self.body_shape + (6,))
        self._numbers("twist", twist, self.body_shape + (6,))
        if twist_change is not None:
            self._numbers("twist_change", twist_change, self.body_shape + (6,))
        if kinematic is not None:
            self._given("kinematic", "kinematic", kinematic, "uint8", self.body_shape)
        for name, value in (("arm_a", arm_a), ("arm_b", arm_b), ("normal", normal)):
            self._numbers(name, value, self.contact_shape + (3,))
        for name, value in (("mu", mu), ("depth", depth), ("restitution", restitution)):
            if value is None:
                value = self.framework.zeros(self.contact_shape, self.dtype, self.device)
            self._numbers(name, value, self.contact_shape)
        return self

    @classmethod
    def from_file(cls, path: str | os.PathLike, dtype: str = "float64") -> Batch:
        """The batch of a contact-batch or FCLIB file, numbers rounded to `dtype`.

        `extras` has the file's contents beside the problem, where there are any. Its names are env_name, lambda_ref (a
        reference solution), v_ref, v_free, target, cone_id, step, dt, J and M as CSR.
        """
        dtype = str(np.dtype(dtype))
        if dtype not in FLOATS:
            raise TypeError(f"dtype: expected float32 or float64, got {dtype}")
        law, arrays, extras = _core.read(os.fspath(path), dtype == "float64")
        self = cls("delassus", NUMPY, dtype, "cpu", law)
        self.extras = extras
        sizes = np.diff(arrays["cone_row_offsets"])
        self.layout = Flat(arrays["env_row_offsets"], arrays["cone_kind"], sizes, arrays["env_cone_offsets"])
        self._integers(self.layout.integers)
        for name, array in arrays.items():
            self._put(name, name, array)
        return self

    # -- pieces -------------------------------------------------------------------------------------------------------

    @classmethod
    def _from_list(cls, A, b, cones, mu, R, lo, hi, law, groups, accuracy):
        joined = join_matrices(A, b, cones, mu, R, lo, hi, groups)
        self = cls("delassus", NUMPY, joined.dtype, "cpu", law)
        self.layout = Flat(joined.offsets, joined.kinds, joined.dims)
        self.arrays["offsets"] = joined.offsets
        self._numbers("A", joined.A, joined.A.shape)
        self._integers(joined.structure)
        self._numbers("b", joined.b, self.layout.row_shape)
        self._rows(joined.mu, joined.R, joined.lo, joined.hi, joined.groups, accuracy)
        return self

    def _flat_jacobian(self, J, M, dof_offsets, indptr, indices, mass_block):
        env_count = self.layout.env_count
        self._given("env_dof_offsets", "dof_offsets", dof_offsets, "int64", (env_count + 1,))
        dofs = np.diff(as_numpy("dof_offsets", dof_offsets))
        rows = np.diff(self.layout.integers["env_row_offsets"])
        if indptr is None:
            self._numbers("J", J, (int((rows * dofs).sum()),))
            self._integers({"row_offsets": offsets_of(np.repeat(dofs, rows))})
        else:
            self._numbers("J", J, ("entries",))
            self._given("row_offsets", "indptr", indptr, "int64", (self.layout.row_count + 1,))
            self._given("column", "indices", indices, "int32", (self._seen["J"].size,))
        self.mass_block = 0 if mass_block is None else whole("mass_block", mass_block)
        entries = dofs * (self.mass_block or dofs)
        self._numbers("M", M, (int(entries.sum()),))
        self._integers({"env_mass_offsets": offsets_of(entries)})
        self.dof_shape = (int(dofs.sum()),)

    def _mass(self, M, env_count, dofs):
        """Takes M and returns the rows of its blocks."""
        shape = look("M", M).shape
        if len(shape) == 4 and shape[2] == shape[3] and shape[2] > 0 and shape[1] * shape[2] == dofs:
            self._numbers("M", M, (env_count, dofs // shape[2], shape[2], shape[2]))
            return shape[2]
        if len(shape) == 2:
            self._numbers("M", M, (env_count, dofs))
            return 1
        self._numbers("M", M, (env_count, dofs, dofs))
        return 0

    # -- what it holds ------------------------------------------------------------------------------------------------

    def __len__(self) -> int:
        """Environments."""
        return self._env_count if self.form == "bodies" else self.layout.env_count

    def __getattr__(self, name):
        arrays = self.__dict__.get("arrays", {})
        if name in arrays:
            return arrays[name]
        raise AttributeError(f"a batch of form {self.__dict__.get('form')!r} has no {name!r}; it has "
                             f"{', '.join(arrays)}")

    def __repr__(self):
        return f"<stiction.Batch {self.form}, {len(self)} environments, {self.rows} rows, {self.dtype} on {self.device}>"

    @property
    def rows(self) -> int:
        """Rows of all environments together, room included where arrays are padded."""
        return 3 * int(np.prod(self.contact_shape)) if self.form == "bodies" else self.layout.row_count

    def rows_of(self, env: int):
        """Index of one environment's rows in arrays of the solution's shape."""
        if not 0 <= env < len(self):
            raise IndexError(f"env: expected 0 to {len(self) - 1}, got {env}")
        if self.form == "bodies":
            if len(self.contact_shape) == 2:
                return env, slice(None)
            first, last = as_numpy("contact_offsets", self.contact_offsets)[env:env + 2]
            return slice(int(first), int(last))
        return self.layout.rows_of(env)

    def as_bodies(self) -> JacobianBodies:
        """The rigid bodies and contact points of a host batch of J and M, for the solvers of bodies, including
        "multigrid". Each environment has six degrees of freedom a body, in world axes; docs/howto/jacobian.md has the
        other conditions. The arrays are copies. Raises stiction.Error (unsupported) that names the first body or row
        that is no such thing.
        """
        if self.form != "jacobian":
            raise ValueError(f"as_bodies: expected a batch of form 'jacobian', got {self.form!r}")
        if self.device != "cpu":
            raise ValueError(f"as_bodies: expected a batch on cpu, got one on {self.device}: copy its arrays to the host")
        self._refresh()
        return JacobianBodies(self)

    def set_accuracy(self, accuracy: Accuracy) -> None:
        """Tolerance and iteration limit from now on, as `AccuracyPolicy.apply` makes them: numbers, or one per
        environment. Raises TypeError or ValueError for negative or fractional ones, for NaN, and for another count.
        """
        if self.form == "bodies":
            raise ValueError("accuracy: expected a batch of form 'delassus' or 'jacobian', got 'bodies'")
        if not isinstance(accuracy, Accuracy):
            raise TypeError(f"accuracy: expected a stiction.Accuracy(tolerance, max_iterations), got {accuracy!r}")

        def spread(array):
            array = np.ascontiguousarray(spread_over("accuracy", array, len(self)))
            return array if self.framework is NUMPY else self.framework.from_numpy(array, self.device)

        self._accuracy(spread(each_not_negative("accuracy.tolerance", accuracy.tolerance)),
                       spread(each_count("accuracy.max_iterations", accuracy.max_iterations)))
        self._views = {}

    def as_jacobian(self) -> Batch:
        """The contacts of a host batch of bodies as rows of J and M: normal, two tangents, six degrees of freedom a body. The
        arrays are copies. Impulses of contacts are reactions of these rows, in that order. Degrees of freedom that
        nothing can move have no entries, a mass of 1, and their motion in `target`. Raises ValueError for substeps,
        and for a limit of contacts that leaves some out.
        """
        if self.form != "bodies":
            raise ValueError(f"as_jacobian: expected a batch of form 'bodies', got {self.form!r}")
        if self.device != "cpu":
            raise ValueError(f"as_jacobian: expected a batch on cpu, got one on {self.device}: copy its arrays to the host")
        arrays, options = jacobian_arguments(self)
        return Batch.from_jacobian(*arrays, **options)

    def save(self, path: str | os.PathLike) -> None:
        """Writes the batch to a contact-batch file, in float64 and without room between environments; also the
        reference, names and contact ids it was read with. A file of J and M holds A as well. For bodies it holds the
        result of as_jacobian().
        """
        if self.device != "cpu":
            raise ValueError(f"save: expected a batch on cpu, got one on {self.device}: copy its arrays to the host")
        if self.form == "bodies":
            self.as_jacobian().save(path)
            return
        self._refresh()
        kept = {name: _core.Array(value) for name, value in self.extras.items()
                if name in ("lambda_ref", "cone_id", "step", "dt")}
        _core.write(os.fspath(path), self._view(False), kept, self.extras.get("env_name", []),
                    self.extras.get("source", "") or f"stiction {_core.version}, Python")


def check_host_matrices(batch, remedy="copy its arrays to the host"):
    """Raises where a batch is not one of matrices, or of J and M, on the host."""
    if not isinstance(batch, Batch):
        raise TypeError(f"batch: expected a stiction.Batch, got {type(batch).__name__}")
    if batch.form == "bodies":
        raise ValueError("batch: expected a batch of form 'delassus' or 'jacobian', got 'bodies'")
    if batch.device != "cpu":
        raise ValueError(f"batch: expected a batch on cpu, got one on {batch.device}: {remedy}")


def _law(law, known=("convex", "coulomb")):
    if law not in known:
        raise ValueError(f"law: expected {', '.join(map(repr, known[:-1]))} or {known[-1]!r}, got {law!r}")
    return law
