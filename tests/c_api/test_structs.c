#include <stddef.h>

#include "check.h"
#include "two_blocks.h"

/* Layouts that programs were compiled against. These numbers may grow and may not change otherwise. */
static void layouts(void) {
  if (sizeof(void*) != 8) return;
  STICTION_CHECK(sizeof(stiction_status) == 32 && offsetof(stiction_status, code) == 24);
  STICTION_CHECK(offsetof(stiction_status, islands) == 28);
  STICTION_CHECK(sizeof(stiction_warm_start_record) == 16 && sizeof(stiction_residual) == 16);
  STICTION_CHECK(sizeof(stiction_worst_contact) == 24);
  STICTION_CHECK(sizeof(stiction_solver_options) == 72 && offsetof(stiction_solver_options, solver) == 24);
  STICTION_CHECK(sizeof(stiction_capacity) == 64 && offsetof(stiction_capacity, precision) == 56);
  STICTION_CHECK(sizeof(stiction_warm_start_options) == 24);
  STICTION_CHECK(sizeof(stiction_batch_view) == 264 && offsetof(stiction_batch_view, hi) == 256);
  STICTION_CHECK(offsetof(stiction_batch_view, env_count) == 24 && offsetof(stiction_batch_view, A) == 176);
  STICTION_CHECK(sizeof(stiction_solution) == 32);
  STICTION_CHECK(sizeof(stiction_jacobian_capacity) == 72);
  STICTION_CHECK(sizeof(stiction_jacobian_view) == 256 && offsetof(stiction_jacobian_view, J) == 192);
  STICTION_CHECK(sizeof(stiction_jacobian_solution) == 40);
  STICTION_CHECK(sizeof(stiction_time_stepping) == 48);
  STICTION_CHECK(sizeof(stiction_body_options) == 80 && offsetof(stiction_body_options, ordering) == 68);
  STICTION_CHECK(sizeof(stiction_body_view) == 160 && offsetof(stiction_body_view, restitution) == 152);
  STICTION_CHECK(sizeof(stiction_body_solution) == 40);
  STICTION_CHECK(sizeof(stiction_gradient_status) == 32 && sizeof(stiction_derivative_options) == 48);
  STICTION_CHECK(sizeof(stiction_solution_numbers) == 32 && sizeof(stiction_batch_numbers) == 64);
  STICTION_CHECK(sizeof(stiction_jacobian_numbers) == 72 && sizeof(stiction_sweeps) == 48);
}

/* The defaults are those that the C++ headers document. */
static void defaults(void) {
  stiction_solver_options options;
  stiction_body_options bodies;
  stiction_time_stepping stepping;
  stiction_warm_start_options warm;
  stiction_jacobian_capacity capacity;
  stiction_batch_view batch;
  memset(&options, 0xff, sizeof options);
  STICTION_CHECK_OK(stiction_solver_options_init(&options, sizeof options));
  STICTION_CHECK(options.size == sizeof options && options.solver == STICTION_SOLVER_NPGS);
  STICTION_CHECK(options.law == STICTION_LAW_OF_BATCH && options.tolerance == 1e-4 && options.omega == 1);
  STICTION_CHECK(options.max_iterations == 1000 && options.stall_window == 2000 && options.threads == 0);
  STICTION_CHECK(options.invalid == STICTION_INVALID_REJECT && options.islands == STICTION_ISLANDS_TOGETHER);
  STICTION_CHECK(options.direct_rows == 1024 && options.choose == STICTION_CHOICE_NAMED);
  STICTION_CHECK_OK(stiction_body_options_init(&bodies, sizeof bodies));
  STICTION_CHECK(STICTION_LAW_BOXED == 2);
  STICTION_CHECK(bodies.iterations == 50 && bodies.law == STICTION_LAW_COULOMB && bodies.momentum == 1);
  STICTION_CHECK(bodies.substeps == 1 && bodies.preconditioner == STICTION_PRECONDITIONER_MULTIGRID);
  STICTION_CHECK(bodies.cycle == STICTION_CYCLE_V && bodies.ordering == STICTION_ORDERING_REVERSE_CUTHILL_MCKEE);
  STICTION_CHECK_OK(stiction_time_stepping_init(&stepping, sizeof stepping));
  STICTION_CHECK(stepping.dt == 0.005 && stepping.erp == 0.2 && stepping.restitution_threshold == 0.1);
  STICTION_CHECK_OK(stiction_warm_start_options_init(&warm, sizeof warm));
  STICTION_CHECK(warm.beta == 0.95 && warm.scaling == STICTION_STEP_CAPPED);
  STICTION_CHECK_OK(stiction_jacobian_capacity_init(&capacity, sizeof capacity));
  STICTION_CHECK(capacity.factor_use == STICTION_FACTOR_BY_SIZE && capacity.envs == 0 && capacity.semidefinite == 0);
  memset(&batch, 0xff, sizeof batch);
  STICTION_CHECK_OK(stiction_batch_view_init(&batch, sizeof batch));
  STICTION_CHECK(batch.size == sizeof batch && batch.A == NULL && batch.env_count == 0 && batch.mu_count == 0);
}

static void presets(void) {
  stiction_solver_options options;
  STICTION_CHECK_OK(stiction_solver_options_init(&options, sizeof options));
  options.threads = 3;
  STICTION_CHECK_OK(stiction_solver_options_preset(&options, "assembly"));
  STICTION_CHECK(options.solver == STICTION_SOLVER_AUTO && options.tolerance == 1e-6 && options.threads == 3);
  STICTION_CHECK_FAILS(stiction_solver_options_preset(&options, "dancing"), STICTION_INVALID_ARGUMENT, "dancing",
                       "locomotion");
}

/* A program compiled before max_iterations and later fields: those bytes are not its options. */
static void shorter_struct(void) {
  const size_t before = offsetof(stiction_solver_options, max_iterations);
  stiction_solver_options options;
  stiction_solver* solver = NULL;
  stiction_batch_view batch;
  stiction_solution solution;
  stiction_status status[2];
  double lambda[6];
  memset(&options, 0xff, sizeof options);
  STICTION_CHECK_OK(stiction_solver_options_init(&options, before));
  STICTION_CHECK(options.size == before && options.omega == 1);
  STICTION_CHECK(options.max_iterations == -1 && options.direct_rows == -1);
  options.tolerance = 0;
  STICTION_CHECK_OK(stiction_solver_create("cpu", &options, NULL, &solver));
  two_blocks(&batch, STICTION_F64);
  STICTION_CHECK_OK(stiction_solution_init(&solution, sizeof solution));
  solution.lambda = lambda;
  solution.status = status;
  STICTION_CHECK_OK(stiction_solver_solve(solver, &batch, &solution, NULL, NULL));
  STICTION_CHECK(status[0].iterations > 0 && status[0].residual <= 1e-15);
  STICTION_CHECK_OK(stiction_solver_destroy(solver));
}

static void wrong_sizes(void) {
  stiction_solver_options options;
  stiction_solver* solver = NULL;
  struct {
    stiction_solver_options known;
    double appended;
  } later;
  STICTION_CHECK_FAILS(stiction_solver_options_init(&later.known, sizeof later), STICTION_INVALID_ARGUMENT,
                       "options.size = 80", "later version");
  STICTION_CHECK_OK(stiction_solver_options_init(&options, sizeof options));
  options.size = sizeof later;
  STICTION_CHECK_FAILS(stiction_solver_create("cpu", &options, NULL, &solver), STICTION_INVALID_ARGUMENT,
                       "options.size = 80", "later version");
  options.size = 0;
  STICTION_CHECK_FAILS(stiction_solver_create("cpu", &options, NULL, &solver), STICTION_INVALID_ARGUMENT,
                       "options.size = 0", "init function");
  options.size = 20;
  STICTION_CHECK_FAILS(stiction_solver_create("cpu", &options, NULL, &solver), STICTION_INVALID_ARGUMENT,
                       "options.size = 20", "init function");
  STICTION_CHECK_FAILS(stiction_solver_options_init(NULL, sizeof options), STICTION_INVALID_ARGUMENT, "options is null",
                       "struct");
  STICTION_CHECK_OK(stiction_solver_options_init(&options, sizeof options));
  options.direct_rows = 7;
  STICTION_CHECK_FAILS(stiction_solver_create("cpu", &options, NULL, &solver), STICTION_INVALID_ARGUMENT,
                       "direct_rows = 7", "must be from 1024 to 32768");
  STICTION_CHECK_OK(stiction_solver_options_init(&options, sizeof options));
  options.choose = 7;
  STICTION_CHECK_FAILS(stiction_solver_create("cpu", &options, NULL, &solver), STICTION_INVALID_ARGUMENT,
                       "options.choose = 7", "1");
  stiction_capacity capacity;
  STICTION_CHECK_OK(stiction_capacity_init(&capacity, sizeof capacity));
  capacity.semidefinite = 7;
  STICTION_CHECK_FAILS(stiction_solver_create("cpu", NULL, &capacity, &solver), STICTION_INVALID_ARGUMENT,
                       "capacity.semidefinite = 7", "must be 0 or 1");
  STICTION_CHECK(solver == NULL);
}

int main(void) {
  layouts();
  defaults();
  presets();
  shorter_struct();
  wrong_sizes();
  return failures != 0;
}
