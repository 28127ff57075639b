#pragma once

/** \file
 * The C interface of stiction: many environments' frictional contact problems, solved in one call, with the same bits
 * on every device (docs/reference/c_api.md). C99 and C++.
 *
 * Calls return a stiction_code and let no exception out; the message is in stiction_last_error() of the same thread. A
 * call that failed has written nothing, unless the device itself failed. Numerical trouble is no failure: it is in the
 * status record of the environment.
 *
 * Structs that begin with `size` are set up by their stiction_..._init(&it, sizeof it), which fills in the defaults. A
 * later version of the library may append fields and still takes the shorter struct of a program compiled before it. A
 * longer struct than the library knows is refused. Enumerators are kept in fields of type int32_t.
 *
 * A handle is a ticket: one that was destroyed is refused, and never comes up again. Use one handle from one thread at
 * a time; different handles from any threads. Null is a handle that destroy accepts.
 *
 * Text arguments are null-terminated. Arrays are the caller's and have lengths given in brackets. They are not kept
 * after the call (on a device: after the work queued on the stream is done). "Real" is float or double, by
 * `precision`. */

#include <stddef.h>
#include <stdint.h>

#include "stiction_body_structs.h"
#include "stiction_derivative_structs.h"
#include "stiction_structs.h"

#if defined(__GNUC__)
#define STICTION_API __attribute__((visibility("default")))
#else
#define STICTION_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* ---- The library ---- */

/** Version of the library, "major.minor.patch". */
STICTION_API const char* stiction_version(void);
/** STICTION_ABI_VERSION that the library was built with: the number in the name libstiction.so.N. */
STICTION_API int32_t stiction_abi_version(void);
/** Numerics epoch: results keep their bits within one (docs/explanation/numerics.md). */
STICTION_API int32_t stiction_epoch(void);

/** Message of the last call that failed on this thread; "" if none did. Valid until the next failure here. */
STICTION_API const char* stiction_last_error(void);
/** "ok", "invalid_argument", ...; "unknown" for a number that is no code. */
STICTION_API const char* stiction_code_name(int32_t code);
/** Name of an env_code of a status record: "solved", ... */
STICTION_API const char* stiction_env_code_name(int32_t env_code);
/** Name of a solver: "npgs", ... */
STICTION_API const char* stiction_solver_name(int32_t solver);
/** Name of one flag bit: "non_finite_input", ... */
STICTION_API const char* stiction_flag_name(uint32_t flag);
/** The solver of that name. */
STICTION_API stiction_code stiction_solver_from_name(const char* name, int32_t* solver);

/** The devices of this machine, one to a line: "cpu: AVX2", "cuda: not usable: ...". Writes at most `room` bytes with
 * the terminating zero, and to `length` (may be null) the length of the whole text without it. text may be null if
 * room is 0. */
STICTION_API stiction_code stiction_devices(char* text, size_t room, size_t* length);

/* ---- Structs: defaults. `size` is sizeof of the struct that the caller has. ---- */

/** Sets up options of a solver with its defaults. */
STICTION_API stiction_code stiction_solver_options_init(stiction_solver_options* options, size_t size);
/** Sets up a capacity with its defaults. */
STICTION_API stiction_code stiction_capacity_init(stiction_capacity* capacity, size_t size);
/** Sets up a batch with its defaults. */
STICTION_API stiction_code stiction_batch_view_init(stiction_batch_view* batch, size_t size);
/** Sets up a solution with its defaults. */
STICTION_API stiction_code stiction_solution_init(stiction_solution* solution, size_t size);
/** Sets up a capacity for Jacobian batches with its defaults. */
STICTION_API stiction_code stiction_jacobian_capacity_init(stiction_jacobian_capacity* capacity, size_t size);
/** Sets up a Jacobian batch with its defaults. */
STICTION_API stiction_code stiction_jacobian_view_init(stiction_jacobian_view* batch, size_t size);
/** Sets up a solution of one with its defaults. */
STICTION_API stiction_code stiction_jacobian_solution_init(stiction_jacobian_solution* solution, size_t size);
/** Sets up time stepping with its defaults. */
STICTION_API stiction_code stiction_time_stepping_init(stiction_time_stepping* stepping, size_t size);
/** Sets up options of a body solver with its defaults. */
STICTION_API stiction_code stiction_body_options_init(stiction_body_options* options, size_t size);
/** Sets up a batch of bodies with its defaults. */
STICTION_API stiction_code stiction_body_view_init(stiction_body_view* batch, size_t size);
/** Sets up a solution of one with its defaults. */
STICTION_API stiction_code stiction_body_solution_init(stiction_body_solution* solution, size_t size);
/** Sets up options of a warm start with its defaults. */
STICTION_API stiction_code stiction_warm_start_options_init(stiction_warm_start_options* options, size_t size);

/** Options of a preset: "navigation", "locomotion", "grasping", "assembly" (docs/reference/cli.md). `options` was set
 * up before.
 */
STICTION_API stiction_code stiction_solver_options_preset(stiction_solver_options* options, const char* preset);
/** Capacity that a batch in host memory needs. `capacity` was set up before. */
STICTION_API stiction_code stiction_capacity_of(const stiction_batch_view* batch, stiction_capacity* capacity);

/* ---- Contact batches: A, b and cones ---- */

/** Makes a solver. device: "auto", "cpu", "cuda", "cuda:N", "emulated". options and capacity may be null: defaults.
 * Without a capacity a GPU makes room as batches need it; a solve that is captured into a graph needs one. */
STICTION_API stiction_code stiction_solver_create(const char* device, const stiction_solver_options* options,
                                                  const stiction_capacity* capacity, stiction_solver** solver);
/** Destroys a solver when its work is done; null is accepted. */
STICTION_API stiction_code stiction_solver_destroy(stiction_solver* solver);

/** Solves every environment. warm_start (Real, row_count, same memory) may be null: from zero. stream: a cudaStream_t,
 * or null for the default stream; the CPU ignores it. Host batches are complete on return. Batches in device memory are
 * planned there: nothing waits or is allocated within the capacity, and the call can be captured. */
STICTION_API stiction_code stiction_solver_solve(stiction_solver* solver, const stiction_batch_view* batch,
                                                 const stiction_solution* solution, const void* warm_start,
                                                 void* stream);
/** Decides in advance, from a batch's structure, all that solve decides each time. The solver keeps the latest plan.
 */
STICTION_API stiction_code stiction_solver_plan(stiction_solver* solver, const stiction_batch_view* batch,
                                                void* stream);
/** Solves a batch of the structure that was planned. */
STICTION_API stiction_code stiction_solver_solve_planned(stiction_solver* solver, const stiction_batch_view* batch,
                                                         const stiction_solution* solution, const void* warm_start,
                                                         void* stream);
/** Returns when the work queued on `stream` is done; at once on the CPU. */
STICTION_API stiction_code stiction_solver_synchronize(stiction_solver* solver, void* stream);

/** Looks for the first broken precondition of a host batch; found: STICTION_INVALID_ARGUMENT, and the error text names
 * its place. solver: stiction_solver_kind, for lemke takes environments that others do not. */
STICTION_API stiction_code stiction_validate(const stiction_batch_view* batch, int32_t solver);
/** The residual of given reactions, by code that the solvers do not share. lambda: Real (row_count); residual:
 * (env_count). The batch's own law; host memory. */
STICTION_API stiction_code stiction_verify(const stiction_batch_view* batch, const void* lambda,
                                           stiction_residual* residual);
/** The contact that is furthest from its law in each environment, by the same code. lambda: Real (row_count); worst:
 * (env_count). */
STICTION_API stiction_code stiction_worst_contacts(const stiction_batch_view* batch, const void* lambda,
                                                   stiction_worst_contact* worst);
/** Hash of the bits of an array on the host, the one that the command line prints. precision: stiction_precision. */
STICTION_API stiction_code stiction_hash(int32_t precision, const void* values, int64_t count, uint64_t* hash);

/* ---- Jacobian batches: J, M and velocities (docs/howto/jacobian.md) ---- */

/** Room that a host batch needs. `capacity` was set up before, and its factor_use is read. */
STICTION_API stiction_code stiction_jacobian_capacity_of(const stiction_jacobian_view* batch,
                                                         stiction_jacobian_capacity* capacity);
/** Room that any batch of `envs` environments needs whose largest has so many rows, cones and degrees of freedom.
 * `capacity` was set up before, and its factor_use is read. */
STICTION_API stiction_code stiction_jacobian_capacity_of_largest(int64_t envs, int32_t env_rows, int32_t env_cones,
                                                                 int32_t env_dofs,
                                                                 stiction_jacobian_capacity* capacity);
/** Makes a solver for batches of capacity->precision. options may be null: defaults. */
STICTION_API stiction_code stiction_jacobian_solver_create(const char* device, const stiction_solver_options* options,
                                                           const stiction_jacobian_capacity* capacity,
                                                           stiction_jacobian_solver** solver);
/** Destroys a solver when its work is done; null is accepted. */
STICTION_API stiction_code stiction_jacobian_solver_destroy(stiction_jacobian_solver* solver);
/** Assembles, solves and moves the velocities; arguments as in stiction_solver_solve. */
STICTION_API stiction_code stiction_jacobian_solver_solve(stiction_jacobian_solver* solver,
                                                          const stiction_jacobian_view* batch,
                                                          const stiction_jacobian_solution* solution,
                                                          const void* warm_start, void* stream);
/** Solves as stiction_jacobian_solver_solve, from velocities too (Real, dof_count, same memory; null: without). They
 * may be the solution's own: docs/howto/jacobian.md. */
STICTION_API stiction_code stiction_jacobian_solver_solve_from(stiction_jacobian_solver* solver,
                                                               const stiction_jacobian_view* batch,
                                                               const stiction_jacobian_solution* solution,
                                                               const void* warm_start, const void* warm_velocities,
                                                               void* stream);
/** Returns when the work queued on `stream` is done; at once on the CPU. */
STICTION_API stiction_code stiction_jacobian_solver_synchronize(stiction_jacobian_solver* solver, void* stream);

/* ---- Derivatives of solutions (docs/math/derivative.md) ---- */

/** Sets up options of a derivative with its defaults. */
STICTION_API stiction_code stiction_derivative_options_init(stiction_derivative_options* options, size_t size);
/** Sets up numbers of a solution: null pointers. */
STICTION_API stiction_code stiction_solution_numbers_init(stiction_solution_numbers* numbers, size_t size);
/** Sets up numbers of a contact batch: null pointers. */
STICTION_API stiction_code stiction_batch_numbers_init(stiction_batch_numbers* numbers, size_t size);
/** Sets up numbers of a Jacobian batch: null pointers. */
STICTION_API stiction_code stiction_jacobian_numbers_init(stiction_jacobian_numbers* numbers, size_t size);
/** Sets up sweeps: one, of relaxation 1, from zero. */
STICTION_API stiction_code stiction_sweeps_init(stiction_sweeps* sweeps, size_t size);
/** Name of one stiction_gradient_flag bit: "unconverged", ... */
STICTION_API const char* stiction_gradient_flag_name(uint32_t flag);
/** Makes a derivative. options may be null: defaults. A device needs capacity->env_rows, and env_dofs for factors and
 * for J and M; for the CPU capacity may be null. */
STICTION_API stiction_code stiction_derivative_create(const char* device, const stiction_derivative_options* options,
                                                      const stiction_capacity* capacity,
                                                      stiction_derivative** derivative);
/** Destroys a derivative; null is accepted. */
STICTION_API stiction_code stiction_derivative_destroy(stiction_derivative* derivative);
/** Pulls `count` sets of cotangents of reactions and motion back to the numbers of a batch. lambda: the reactions of a
 * solve, Real (row_count). status: its records, or null (env_count). gradient_status: (env_count). */
STICTION_API stiction_code stiction_derivative_vjp(stiction_derivative* derivative, const stiction_batch_view* batch,
                                                   const void* lambda, const stiction_status* status,
                                                   const stiction_solution_numbers* cotangents,
                                                   const stiction_batch_numbers* gradients,
                                                   stiction_gradient_status* gradient_status, int64_t count,
                                                   void* stream);
/** Pushes `count` sets of changes of a batch forward to its solution; the other arguments as in
 * stiction_derivative_vjp. */
STICTION_API stiction_code stiction_derivative_jvp(stiction_derivative* derivative, const stiction_batch_view* batch,
                                                   const void* lambda, const stiction_status* status,
                                                   const stiction_batch_numbers* tangents,
                                                   const stiction_solution_numbers* changes,
                                                   stiction_gradient_status* gradient_status, int64_t count,
                                                   void* stream);
/** Pulls cotangents of reactions, motion and velocities back to J, M, v_free and the rows' numbers; the other
 * arguments as in stiction_derivative_vjp. */
STICTION_API stiction_code stiction_derivative_vjp_jacobian(
    stiction_derivative* derivative, const stiction_jacobian_view* batch, const void* lambda,
    const stiction_status* status, const stiction_solution_numbers* cotangents,
    const stiction_jacobian_numbers* gradients, stiction_gradient_status* gradient_status, int64_t count, void* stream);
/** Pushes changes of J, M, v_free and the rows' numbers forward to reactions, motion and velocities; the other
 * arguments as in stiction_derivative_vjp. */
STICTION_API stiction_code stiction_derivative_jvp_jacobian(
    stiction_derivative* derivative, const stiction_jacobian_view* batch, const void* lambda,
    const stiction_status* status, const stiction_jacobian_numbers* tangents, const stiction_solution_numbers* changes,
    stiction_gradient_status* gradient_status, int64_t count, void* stream);
/** Pulls the results' cotangents of so many sweeps of solver `pgs` to the batch and to where they began. It is the
 * derivative of the iterations as they run: of a solve with tolerance 0, stall_window 0 and max_iterations =
 * sweeps->count. sweeps: a struct from stiction_sweeps_init. The other arguments as in stiction_derivative_vjp. */
STICTION_API stiction_code stiction_derivative_unrolled_vjp(
    stiction_derivative* derivative, const stiction_batch_view* batch, const stiction_sweeps* sweeps,
    const stiction_solution_numbers* cotangents, const stiction_batch_numbers* gradients,
    stiction_gradient_status* gradient_status, int64_t count, void* stream);
/** Returns when the work queued on `stream` is done; at once on the CPU. */
STICTION_API stiction_code stiction_derivative_synchronize(stiction_derivative* derivative, void* stream);

/* ---- Bodies and contact points (docs/howto/bodies.md) ---- */

/** Makes a solver. stepping and options may be null: defaults. */
STICTION_API stiction_code stiction_body_solver_create(const char* device, const stiction_time_stepping* stepping,
                                                       const stiction_body_options* options,
                                                       stiction_body_solver** solver);
/** Destroys a solver when its work is done; null is accepted. */
STICTION_API stiction_code stiction_body_solver_destroy(stiction_body_solver* solver);
/** Plans a batch: colours, order, which bodies touch. It is for batches in device memory, whose structure solve cannot
 * see. Call it before the first solve and whenever offsets, body numbers, `kinematic` or, with max_contacts_per_env,
 * depths changed. */
STICTION_API stiction_code stiction_body_solver_plan(stiction_body_solver* solver, const stiction_body_view* batch,
                                                     void* stream);
/** Solves every environment. warm_start (Real, 3 * contact_count, same memory) may be null: from zero. A host batch is
 * planned here whenever its structure is not the one before; a batch in device memory has to be planned. */
STICTION_API stiction_code stiction_body_solver_solve(stiction_body_solver* solver, const stiction_body_view* batch,
                                                      const stiction_body_solution* solution, const void* warm_start,
                                                      void* stream);

/* ---- A simulation loop: reactions stored by contact id (docs/howto/warm_start.md) ---- */

/** Makes a solver for batches of capacity->precision with at most the capacity's envs, rows and cones. options and
 * warm_start may be null: defaults. */
STICTION_API stiction_code stiction_stepping_solver_create(const char* device, const stiction_solver_options* options,
                                                           const stiction_capacity* capacity,
                                                           const stiction_warm_start_options* warm_start,
                                                           stiction_stepping_solver** solver);
/** Makes a stepping solver for Jacobian batches. */
STICTION_API stiction_code stiction_stepping_solver_create_jacobian(const char* device,
                                                                    const stiction_solver_options* options,
                                                                    const stiction_jacobian_capacity* capacity,
                                                                    const stiction_warm_start_options* warm_start,
                                                                    stiction_stepping_solver** solver);
/** Makes one for bodies. stepping may be null: defaults. Three fields of the capacity are read: envs, cones (contacts
 * of all environments) and precision. */
STICTION_API stiction_code stiction_stepping_solver_create_bodies(const char* device,
                                                                  const stiction_time_stepping* stepping,
                                                                  const stiction_body_options* options,
                                                                  const stiction_capacity* capacity,
                                                                  const stiction_warm_start_options* warm_start,
                                                                  stiction_stepping_solver** solver);
/** Destroys a solver when its work is done; null is accepted. */
STICTION_API stiction_code stiction_stepping_solver_destroy(stiction_stepping_solver* solver);
/** Loads, solves and stores a step of length dt [s]. cone_id: contact ids, unique within an environment
 * (cone_count), in the batch's memory. */
STICTION_API stiction_code stiction_stepping_solver_solve(stiction_stepping_solver* solver,
                                                          const stiction_batch_view* batch, const uint64_t* cone_id,
                                                          double dt, const stiction_solution* solution, void* stream);
/** Solves a step with a solver for Jacobian batches. */
STICTION_API stiction_code stiction_stepping_solver_solve_jacobian(stiction_stepping_solver* solver,
                                                                   const stiction_jacobian_view* batch,
                                                                   const uint64_t* cone_id, double dt,
                                                                   const stiction_jacobian_solution* solution,
                                                                   void* stream);
/** Solves a step of bodies: contact_id: (contact_count), and the step's length is that of its stepping. Plans anew at
 * every step, for which a batch in device memory is waited for. */
STICTION_API stiction_code stiction_stepping_solver_solve_bodies(stiction_stepping_solver* solver,
                                                                 const stiction_body_view* batch,
                                                                 const uint64_t* contact_id,
                                                                 const stiction_body_solution* solution, void* stream);
/** Resets the reactions of environments that start over: a list on the host (count). */
STICTION_API stiction_code stiction_stepping_solver_reset(stiction_stepping_solver* solver, const int64_t* envs,
                                                          int64_t count, void* stream);
/** Resets environment e wherever mask[e] is not zero. mask: (capacity.envs), in the device's memory. */
STICTION_API stiction_code stiction_stepping_solver_reset_where(stiction_stepping_solver* solver, const uint8_t* mask,
                                                                void* stream);
/** Resets everything. */
STICTION_API stiction_code stiction_stepping_solver_reset_all(stiction_stepping_solver* solver, void* stream);
/** Copies the store's records of the first `count` environments to the host; waits for the stream. */
STICTION_API stiction_code stiction_stepping_solver_records(stiction_stepping_solver* solver,
                                                            stiction_warm_start_record* records, int64_t count,
                                                            void* stream);
/** Returns when the work queued on `stream` is done; at once on the CPU. */
STICTION_API stiction_code stiction_stepping_solver_synchronize(stiction_stepping_solver* solver, void* stream);

/* ---- Files (docs/reference/file_formats.md); STICTION_UNSUPPORTED from a library built without HDF5 ---- */

/** Reads a contact-batch or FCLIB file. */
STICTION_API stiction_code stiction_batch_read(const char* path, stiction_batch** batch);
/** Destroys a batch that was read, and the memory of its views; null is accepted. */
STICTION_API stiction_code stiction_batch_destroy(stiction_batch* batch);
/** The batch in f32 or f64 (stiction_precision), in host memory that lives as long as the handle. */
STICTION_API stiction_code stiction_batch_get_view(stiction_batch* batch, int32_t precision, stiction_batch_view* view);
/** Contact ids (cone_count) of the file, null if it has none; they live as long as the handle. */
STICTION_API stiction_code stiction_batch_get_cone_ids(stiction_batch* batch, const uint64_t** cone_id);
/** Writes a host batch as a contact-batch file. source: free text, or null. */
STICTION_API stiction_code stiction_batch_write(const char* path, const stiction_batch_view* batch, const char* source);
/** Writes reactions of a host batch as a solution file. options: those of the solver, of which the file keeps solver
 * and law; null: defaults. source: free text, or null. w and status may be left out of the solution. */
STICTION_API stiction_code stiction_solution_write(const char* path, const stiction_batch_view* batch,
                                                   const stiction_solution* solution,
                                                   const stiction_solver_options* options, const char* source);

#ifdef __cplusplus
}
#endif
