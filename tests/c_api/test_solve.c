#include "check.h"
#include "two_blocks.h"

static double lambda[6], w[6];
static float float_lambda[6];
static stiction_status status[2];

static stiction_solution answer(void* reactions, void* motion) {
  stiction_solution solution;
  stiction_solution_init(&solution, sizeof solution);
  memset(lambda, 0, sizeof lambda);
  memset(w, 0, sizeof w);
  memset(float_lambda, 0, sizeof float_lambda);
  memset(status, 0xff, sizeof status);
  solution.lambda = reactions;
  solution.w = motion;
  solution.status = status;
  return solution;
}

/* The relative residual is at most 1e-4 of max|b| = 9.81, and A is the identity: that is the error, doubled to be sure.
 */
static const double kDistance = 2e-4 * 9.81;

static int near_to(double value, double expected, double distance) {
  return value - expected <= distance && expected - value <= distance;
}

static int is_answer(void) {
  int i, held = 1;
  for (i = 0; i < 6; ++i) held &= near_to(lambda[i], kReactions[i], kDistance) && near_to(w[i], kMotion[i], kDistance);
  return held && status[0].code == STICTION_ENV_SOLVED && status[1].code == STICTION_ENV_SOLVED;
}

static void solves(const char* device, int32_t space) {
  stiction_solver* solver = NULL;
  stiction_batch_view batch;
  stiction_solution solution = answer(lambda, w);
  stiction_residual residual[2];
  stiction_worst_contact worst[2];
  stiction_capacity capacity;
  int i;
  two_blocks(&batch, STICTION_F64);
  STICTION_CHECK_OK(stiction_capacity_init(&capacity, sizeof capacity));
  STICTION_CHECK_OK(stiction_capacity_of(&batch, &capacity));
  STICTION_CHECK(capacity.envs == 2 && capacity.rows == 6 && capacity.cones == 2 && capacity.nonzeros == 6);
  STICTION_CHECK(capacity.env_rows == 3 && capacity.env_nonzeros == 3 && capacity.precision == STICTION_F64);
  batch.space = space;
  STICTION_CHECK_OK(stiction_solver_create(device, NULL, &capacity, &solver));
  STICTION_CHECK_OK(stiction_solver_solve(solver, &batch, &solution, NULL, NULL));
  STICTION_CHECK_OK(stiction_solver_synchronize(solver, NULL));
  STICTION_CHECK(is_answer());
  STICTION_CHECK(status[0].solver == STICTION_SOLVER_NPGS && status[0].flags == 0 && status[0].iterations > 0);

  solution = answer(lambda, w);
  STICTION_CHECK_FAILS(stiction_solver_solve_planned(solver, &batch, &solution, NULL, NULL), STICTION_INVALID_ARGUMENT,
                       "no plan", "stiction_solver_plan");
  STICTION_CHECK_OK(stiction_solver_plan(solver, &batch, NULL));
  STICTION_CHECK_OK(stiction_solver_solve_planned(solver, &batch, &solution, kReactions, NULL));
  STICTION_CHECK_OK(stiction_solver_synchronize(solver, NULL));
  STICTION_CHECK(is_answer());

  batch.space = STICTION_SPACE_HOST;
  STICTION_CHECK_OK(stiction_verify(&batch, kReactions, residual));
  for (i = 0; i < 2; ++i) STICTION_CHECK(residual[i].relative <= 1e-15 && residual[i].absolute <= 1e-14);
  STICTION_CHECK_OK(stiction_verify(&batch, kZeros, residual));
  /* Without a reaction the nearest member of the law is the open contact, -9.81 away (docs/math/residual.md). */
  STICTION_CHECK(near_to(residual[0].absolute, 9.81, 1e-12) && near_to(residual[1].absolute, 9.81, 1e-12));
  STICTION_CHECK(near_to(residual[0].relative, 1, 1e-15) && near_to(residual[1].relative, 1, 1e-15));
  STICTION_CHECK_OK(stiction_worst_contacts(&batch, kZeros, worst));
  for (i = 0; i < 2; ++i) STICTION_CHECK(worst[i].cone == 0 && near_to(worst[i].error, 9.81, 1e-12));
  STICTION_CHECK(near_to(worst[0].scale, 9.81, 1e-12) && worst[0].reserved == 0);
  STICTION_CHECK_FAILS(stiction_worst_contacts(&batch, kZeros, NULL), STICTION_INVALID_ARGUMENT, "worst is null",
                       "room");
  STICTION_CHECK_OK(stiction_solver_destroy(solver));
}

/* Columns are written to after the plan was made: the environment is flagged, the other one has its answer. */
static void isolates(const char* device) {
  stiction_solver* solver = NULL;
  stiction_solver_options options;
  stiction_batch_view batch;
  stiction_solution solution = answer(lambda, w);
  int32_t columns[6];
  int i;
  two_blocks(&batch, STICTION_F64);
  memcpy(columns, kColumns, sizeof columns);
  batch.column = columns;
  STICTION_CHECK_OK(stiction_solver_options_init(&options, sizeof options));
  options.invalid = STICTION_INVALID_ISOLATE;
  STICTION_CHECK_OK(stiction_solver_create(device, &options, NULL, &solver));
  STICTION_CHECK_OK(stiction_solver_plan(solver, &batch, NULL));
  columns[4] = 1000000000;
  STICTION_CHECK_OK(stiction_solver_solve_planned(solver, &batch, &solution, NULL, NULL));
  STICTION_CHECK(status[1].code == STICTION_ENV_INVALID_INPUT && (status[1].flags & STICTION_FLAG_BAD_STRUCTURE) != 0);
  STICTION_CHECK(status[0].code == STICTION_ENV_SOLVED);
  for (i = 0; i < 3; ++i) STICTION_CHECK(near_to(lambda[i], kReactions[i], kDistance) && lambda[3 + i] == 0);
  STICTION_CHECK_FAILS(stiction_solver_solve(solver, &batch, &solution, NULL, NULL), STICTION_INVALID_ARGUMENT,
                       "column[env 1, row 1] = 1000000000", "fix the column");
  columns[4] = 1;
  solution.w = lambda;
  STICTION_CHECK_FAILS(stiction_solver_solve_planned(solver, &batch, &solution, NULL, NULL), STICTION_INVALID_ARGUMENT,
                       "solution.w and solution.lambda overlap", "memory of its own");
  STICTION_CHECK_OK(stiction_solver_destroy(solver));
}

/* Both blocks in one environment. */
static void tells_islands(void) {
  static const int64_t rows[] = {0, 6}, cones[] = {0, 2};
  static const int32_t columns[] = {0, 1, 2, 3, 4, 5};
  stiction_solver* solver = NULL;
  stiction_solver_options options;
  stiction_batch_view batch;
  stiction_solution solution = answer(lambda, w);
  two_blocks(&batch, STICTION_F64);
  batch.env_count = 1;
  batch.env_row_offsets = rows;
  batch.env_cone_offsets = cones;
  batch.column = columns;
  STICTION_CHECK_OK(stiction_solver_options_init(&options, sizeof options));
  STICTION_CHECK_OK(stiction_solver_create("cpu", &options, NULL, &solver));
  STICTION_CHECK_OK(stiction_solver_solve(solver, &batch, &solution, NULL, NULL));
  STICTION_CHECK(status[0].code == STICTION_ENV_SOLVED && status[0].islands == 0);
  STICTION_CHECK_OK(stiction_solver_destroy(solver));
  options.islands = STICTION_ISLANDS_APART;
  STICTION_CHECK_OK(stiction_solver_create("cpu", &options, NULL, &solver));
  STICTION_CHECK_OK(stiction_solver_solve(solver, &batch, &solution, NULL, NULL));
  STICTION_CHECK(status[0].code == STICTION_ENV_SOLVED && status[0].islands == 2);
  STICTION_CHECK_OK(stiction_solver_destroy(solver));
}

static void solves_floats(void) {
  stiction_solver* solver = NULL;
  stiction_batch_view batch;
  stiction_solution solution = answer(float_lambda, NULL);
  int i;
  two_blocks(&batch, STICTION_F32);
  STICTION_CHECK_OK(stiction_solver_create("cpu", NULL, NULL, &solver));
  STICTION_CHECK_OK(stiction_solver_solve(solver, &batch, &solution, NULL, NULL));
  for (i = 0; i < 6; ++i) STICTION_CHECK(near_to((double)float_lambda[i], kReactions[i], kDistance));
  STICTION_CHECK_OK(stiction_solver_destroy(solver));
}

/* The blocks as bodies with one contact each are their own Jacobian: J = M = 1, v_free = b. */
static void jacobians(void) {
  const double identity[] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 0, 0, 0, 1, 0, 0, 0, 1};
  const int64_t entries[] = {0, 3, 6, 9, 12, 15, 18};
  double velocity[6];
  int i;
  stiction_jacobian_solver* solver = NULL;
  stiction_jacobian_capacity capacity, largest;
  stiction_jacobian_view batch;
  stiction_jacobian_solution solution;
  STICTION_CHECK_OK(stiction_jacobian_view_init(&batch, sizeof batch));
  batch.precision = STICTION_F64;
  batch.law = STICTION_LAW_COULOMB;
  batch.mass_block = 1;
  batch.env_count = 2, batch.cone_count = 2, batch.row_count = 6;
  batch.dof_count = 6, batch.entry_count = 18, batch.mass_count = 6;
  batch.env_row_offsets = batch.env_dof_offsets = batch.env_mass_offsets = batch.cone_row_offsets = kEnvRows;
  batch.env_cone_offsets = kEnvCones;
  batch.cone_kind = kKinds;
  batch.row_offsets = entries;
  batch.J = identity;
  batch.M = kA;
  batch.v_free = kB;
  batch.mu = kMu;
  batch.R = batch.lo = batch.hi = kZeros;
  STICTION_CHECK_OK(stiction_jacobian_solution_init(&solution, sizeof solution));
  memset(status, 0xff, sizeof status);
  solution.lambda = lambda, solution.w = w, solution.velocity = velocity, solution.status = status;
  STICTION_CHECK_OK(stiction_jacobian_capacity_init(&capacity, sizeof capacity));
  largest = capacity;
  STICTION_CHECK_OK(stiction_jacobian_capacity_of(&batch, &capacity));
  STICTION_CHECK_OK(stiction_jacobian_capacity_of_largest(2, 3, 1, 3, &largest));
  STICTION_CHECK(capacity.matrix == 18 && capacity.env_dofs == 3 && capacity.precision == STICTION_F64);
  STICTION_CHECK(largest.envs == 2 && largest.rows == 6 && largest.cones == 2 && largest.matrix == 18);
  STICTION_CHECK_OK(stiction_jacobian_solver_create("cpu", NULL, &capacity, &solver));
  STICTION_CHECK_OK(stiction_jacobian_solver_solve(solver, &batch, &solution, NULL, NULL));
  STICTION_CHECK_OK(stiction_jacobian_solver_synchronize(solver, NULL));
  STICTION_CHECK(is_answer());
  for (i = 0; i < 6; ++i) STICTION_CHECK(near_to(velocity[i], kMotion[i], kDistance));
  batch.precision = STICTION_F32;
  STICTION_CHECK_FAILS(stiction_jacobian_solver_solve(solver, &batch, &solution, NULL, NULL), STICTION_INVALID_ARGUMENT,
                       "batch.precision is f32", "made for f64");
  STICTION_CHECK_OK(stiction_jacobian_solver_destroy(solver));
}

/* J = M = 1, so A is the identity and lambda is the nearest semidefinite matrix to -v_free. For the matrix with
 * nothing but ones beside its diagonal it is half of the matrix of ones. */
static void semidefinite_jacobians(const char* device, int32_t space) {
  const double root = 1.41421356237309505, identity[] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, ones[] = {1, 1, 1};
  const double v_free[] = {0, -root, 0}, zeros[3] = {0};
  const int64_t rows[] = {0, 3}, cones[] = {0, 1}, entries[] = {0, 3, 6, 9};
  const uint8_t kinds[] = {STICTION_CONE_SEMIDEFINITE};
  stiction_jacobian_solver* solver = NULL;
  stiction_solver_options options;
  stiction_jacobian_capacity capacity;
  stiction_jacobian_view batch;
  stiction_jacobian_solution solution;
  STICTION_CHECK_OK(stiction_jacobian_view_init(&batch, sizeof batch));
  batch.precision = STICTION_F64;
  batch.mass_block = 1;
  batch.env_count = batch.cone_count = 1;
  batch.row_count = batch.dof_count = batch.mass_count = 3;
  batch.entry_count = 9;
  batch.env_row_offsets = batch.env_dof_offsets = batch.env_mass_offsets = batch.cone_row_offsets = rows;
  batch.env_cone_offsets = cones;
  batch.cone_kind = kinds;
  batch.row_offsets = entries;
  batch.J = identity;
  batch.M = ones;
  batch.v_free = v_free;
  batch.mu = batch.R = batch.lo = batch.hi = zeros;
  STICTION_CHECK_OK(stiction_jacobian_solution_init(&solution, sizeof solution));
  memset(status, 0xff, sizeof status);
  solution.lambda = lambda, solution.w = w, solution.status = status;
  STICTION_CHECK_OK(stiction_jacobian_capacity_init(&capacity, sizeof capacity));
  STICTION_CHECK_OK(stiction_jacobian_capacity_of(&batch, &capacity));
  STICTION_CHECK(capacity.semidefinite == 1);
  STICTION_CHECK_OK(stiction_solver_options_init(&options, sizeof options));
  options.solver = STICTION_SOLVER_JACOBI;
  STICTION_CHECK_OK(stiction_jacobian_solver_create(device, &options, &capacity, &solver));
  batch.space = space;
  STICTION_CHECK_OK(stiction_jacobian_solver_solve(solver, &batch, &solution, NULL, NULL));
  STICTION_CHECK_OK(stiction_jacobian_solver_synchronize(solver, NULL));
  STICTION_CHECK(status[0].code == STICTION_ENV_SOLVED);
  STICTION_CHECK(near_to(lambda[0], 0.5, 1e-3) && near_to(lambda[1], 0.5 * root, 1e-3) &&
                 near_to(lambda[2], 0.5, 1e-3));
  STICTION_CHECK_OK(stiction_jacobian_solver_destroy(solver));
}

/* A body of 2 kg that gravity pushes into the floor for 5 ms. The floor gives 2 kg * 9.81 m/s2 * 5 ms = 0.0981 N s
 * back. */
static void bodies(void) {
  const int64_t offsets[] = {0, 1};
  const double half = 0.5, ones[] = {1, 0, 0, 1, 0, 1}, fall[] = {0, 0, -9.81 * 0.005, 0, 0, 0}, up[] = {0, 0, 1};
  const double friction = 0.5, zeros[6] = {0};
  const int32_t world = -1, first = 0;
  const uint8_t moves[] = {0}, fixed[] = {1};
  double impulse[3], twist[6];
  stiction_body_solver* solver = NULL;
  stiction_body_view batch;
  stiction_body_solution solution;
  STICTION_CHECK_OK(stiction_body_view_init(&batch, sizeof batch));
  batch.precision = STICTION_F64;
  batch.env_count = batch.body_count = batch.contact_count = 1;
  batch.env_body_offsets = batch.env_contact_offsets = offsets;
  batch.inv_mass = &half;
  batch.inv_inertia = ones;
  batch.twist = zeros;
  batch.twist_change = fall;
  batch.body_a = &world;
  batch.body_b = &first;
  batch.arm_a = batch.arm_b = zeros;
  batch.normal = up;
  batch.mu = &friction;
  batch.depth = batch.restitution = zeros;
  batch.kinematic = moves;
  STICTION_CHECK_OK(stiction_body_solution_init(&solution, sizeof solution));
  solution.impulse = impulse, solution.twist = twist, solution.status = status;
  STICTION_CHECK_OK(stiction_body_solver_create("cpu", NULL, NULL, &solver));
  STICTION_CHECK_OK(stiction_body_solver_solve(solver, &batch, &solution, NULL, NULL));
  STICTION_CHECK(near_to(impulse[0], 0.0981, 1e-12) && near_to(twist[2], 0, 1e-12));
  /* This change makes the solver plan anew: the same body, held fast. */
  batch.kinematic = fixed;
  STICTION_CHECK_OK(stiction_body_solver_solve(solver, &batch, &solution, NULL, NULL));
  STICTION_CHECK(impulse[0] == 0 && twist[2] == 0);
  batch.kinematic = NULL;
  STICTION_CHECK_OK(stiction_body_solver_plan(solver, &batch, NULL));
  STICTION_CHECK_OK(stiction_body_solver_solve(solver, &batch, &solution, impulse, NULL));
  STICTION_CHECK(near_to(impulse[0], 0.0981, 1e-12));
  STICTION_CHECK_OK(stiction_body_solver_destroy(solver));
}

/* Contacts 7 and 9 are stored, whichever way a step ends; one environment starts over. */
static void steps(void) {
  const uint64_t cone_id[] = {7, 9};
  const int64_t second = 1;
  const uint8_t mask[] = {1, 0};
  stiction_capacity capacity;
  stiction_stepping_solver* solver = NULL;
  stiction_warm_start_record record[2];
  stiction_batch_view batch;
  stiction_solution solution = answer(lambda, w);
  two_blocks(&batch, STICTION_F64);
  STICTION_CHECK_OK(stiction_capacity_init(&capacity, sizeof capacity));
  STICTION_CHECK_OK(stiction_capacity_of(&batch, &capacity));
  STICTION_CHECK_OK(stiction_stepping_solver_create("cpu", NULL, &capacity, NULL, &solver));
  STICTION_CHECK_OK(stiction_stepping_solver_solve(solver, &batch, cone_id, 0.01, &solution, NULL));
  STICTION_CHECK_OK(stiction_stepping_solver_records(solver, record, 2, NULL));
  STICTION_CHECK(is_answer() && record[0].misses == 1 && record[1].misses == 1);
  STICTION_CHECK_OK(stiction_stepping_solver_reset(solver, &second, 1, NULL));
  STICTION_CHECK_OK(stiction_stepping_solver_solve(solver, &batch, cone_id, 0.01, &solution, NULL));
  STICTION_CHECK_OK(stiction_stepping_solver_records(solver, record, 2, NULL));
  STICTION_CHECK(is_answer() && record[0].hits == 1 && record[1].misses == 1);
  STICTION_CHECK_OK(stiction_stepping_solver_reset_where(solver, mask, NULL));
  STICTION_CHECK_OK(stiction_stepping_solver_solve(solver, &batch, cone_id, 0.01, &solution, NULL));
  STICTION_CHECK_OK(stiction_stepping_solver_records(solver, record, 2, NULL));
  STICTION_CHECK(is_answer() && record[0].misses == 1 && record[1].hits == 1);
  STICTION_CHECK_OK(stiction_stepping_solver_reset_all(solver, NULL));
  STICTION_CHECK_OK(stiction_stepping_solver_synchronize(solver, NULL));
  STICTION_CHECK_FAILS(stiction_stepping_solver_solve(solver, &batch, cone_id, -1, &solution, NULL),
                       STICTION_INVALID_ARGUMENT, "dt", "-1");
  STICTION_CHECK_FAILS(stiction_stepping_solver_reset(solver, NULL, 1, NULL), STICTION_INVALID_ARGUMENT, "envs is null",
                       "one entry");
  STICTION_CHECK_OK(stiction_stepping_solver_destroy(solver));
}

int main(void) {
  solves("cpu", STICTION_SPACE_HOST);
  solves("emulated", STICTION_SPACE_HOST);
  solves("emulated", STICTION_SPACE_CUDA); /* whose device memory is any memory */
  isolates("cpu");
  isolates("emulated");
  tells_islands();
  solves_floats();
  jacobians();
  semidefinite_jacobians("cpu", STICTION_SPACE_HOST);
  semidefinite_jacobians("emulated", STICTION_SPACE_CUDA);
  bodies();
  steps();
  return failures != 0;
}
