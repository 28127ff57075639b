#include <stdlib.h>

#include "check.h"
#include "two_blocks.h"

static void names(void) {
  char text[16], *whole;
  size_t length = 0;
  int32_t solver = -1;
  STICTION_CHECK(strcmp(stiction_last_error(), "") == 0);
  STICTION_CHECK(strcmp(stiction_version(), "0.1.0") == 0 && stiction_epoch() >= 1);
  STICTION_CHECK(stiction_abi_version() == STICTION_ABI_VERSION);
  STICTION_CHECK(strcmp(stiction_code_name(STICTION_BAD_FILE), "bad_file") == 0);
  STICTION_CHECK(strcmp(stiction_code_name(99), "unknown") == 0);
  STICTION_CHECK(strcmp(stiction_env_code_name(STICTION_ENV_STALLED), "stalled") == 0);
  STICTION_CHECK(strcmp(stiction_env_code_name(-1), "unknown") == 0);
  STICTION_CHECK(strcmp(stiction_solver_name(STICTION_SOLVER_AUTO), "auto") == 0);
  STICTION_CHECK(strcmp(stiction_flag_name(STICTION_FLAG_RAY), "ray") == 0);
  STICTION_CHECK_OK(stiction_solver_from_name("ipm", &solver));
  STICTION_CHECK(solver == STICTION_SOLVER_IPM);
  STICTION_CHECK_FAILS(stiction_solver_from_name("impm", &solver), STICTION_INVALID_ARGUMENT, "impm", "npgs");
  STICTION_CHECK_OK(stiction_devices(NULL, 0, &length));
  STICTION_CHECK_OK(stiction_devices(text, sizeof text, NULL));
  STICTION_CHECK(length > sizeof text && strlen(text) == sizeof text - 1 && strncmp(text, "cpu: ", 5) == 0);
  whole = malloc(length + 1);
  STICTION_CHECK_OK(stiction_devices(whole, length + 1, NULL));
  STICTION_CHECK(strlen(whole) == length && strstr(whole, "\ncuda") && strstr(whole, "\nemulated: "));
  free(whole);
}

/* Every argument separately: named, with its value and the remedy. */
static void arguments(void) {
  stiction_solver* solver = NULL;
  stiction_batch_view batch;
  stiction_solution solution;
  stiction_solver_options options;
  stiction_status status[2];
  stiction_residual residual[2];
  double lambda[6] = {1, 2, 3, 4, 5, 6};
  double mu[] = {0, 0.5, 0.5, 0, -0.25, 0.5};
  uint64_t hash = 0;
  two_blocks(&batch, STICTION_F64);
  STICTION_CHECK_OK(stiction_solution_init(&solution, sizeof solution));
  solution.lambda = lambda;
  solution.status = status;
  STICTION_CHECK_FAILS(stiction_solver_create(NULL, NULL, NULL, &solver), STICTION_INVALID_ARGUMENT, "device is null",
                       "cpu");
  STICTION_CHECK_FAILS(stiction_solver_create("cpu", NULL, NULL, NULL), STICTION_INVALID_ARGUMENT, "solver is null",
                       "handle");
  STICTION_CHECK_FAILS(stiction_solver_create("tpu", NULL, NULL, &solver), STICTION_INVALID_ARGUMENT, "'tpu'",
                       "cuda:N");
  STICTION_CHECK_FAILS(stiction_solver_create("cuda:99", NULL, NULL, &solver), STICTION_NO_DEVICE, "'cuda:99'", "cpu");
  STICTION_CHECK_OK(stiction_solver_options_init(&options, sizeof options));
  options.solver = 77;
  STICTION_CHECK_FAILS(stiction_solver_create("cpu", &options, NULL, &solver), STICTION_INVALID_ARGUMENT,
                       "options.solver = 77", "STICTION_SOLVER_NPGS (1)");
  STICTION_CHECK_OK(stiction_solver_options_init(&options, sizeof options));
  options.tolerance = -1;
  STICTION_CHECK_FAILS(stiction_solver_create("cpu", &options, NULL, &solver), STICTION_INVALID_ARGUMENT, "tolerance",
                       "-1");
  STICTION_CHECK(solver == NULL);
  STICTION_CHECK_OK(stiction_solver_create("cpu", NULL, NULL, &solver));
  STICTION_CHECK_FAILS(stiction_solver_solve(solver, NULL, &solution, NULL, NULL), STICTION_INVALID_ARGUMENT,
                       "batch is null", "init");
  STICTION_CHECK_FAILS(stiction_solver_solve(solver, &batch, NULL, NULL, NULL), STICTION_INVALID_ARGUMENT,
                       "solution is null", "init");
  batch.precision = 16;
  STICTION_CHECK_FAILS(stiction_solver_solve(solver, &batch, &solution, NULL, NULL), STICTION_INVALID_ARGUMENT,
                       "batch.precision = 16", "STICTION_F64 (1)");
  two_blocks(&batch, STICTION_F64);
  batch.law = STICTION_LAW_OF_BATCH;
  STICTION_CHECK_FAILS(stiction_solver_solve(solver, &batch, &solution, NULL, NULL), STICTION_INVALID_ARGUMENT,
                       "batch.law = -1", "STICTION_LAW_COULOMB (1)");
  two_blocks(&batch, STICTION_F64);
  batch.space = STICTION_SPACE_CUDA;
  STICTION_CHECK_FAILS(stiction_solver_solve(solver, &batch, &solution, NULL, NULL), STICTION_INVALID_ARGUMENT,
                       "batch.space is cuda", "device is cpu");
  STICTION_CHECK_FAILS(stiction_verify(&batch, lambda, residual), STICTION_INVALID_ARGUMENT, "batch.space is cuda",
                       "host");
  two_blocks(&batch, STICTION_F64);
  batch.mu = mu;
  STICTION_CHECK_FAILS(stiction_solver_solve(solver, &batch, &solution, NULL, NULL), STICTION_INVALID_ARGUMENT,
                       "mu[env 1, cone 0, row 1] = -0.25", "friction must be >= 0");
  STICTION_CHECK_FAILS(stiction_validate(&batch, STICTION_SOLVER_NPGS), STICTION_INVALID_ARGUMENT,
                       "mu[env 1, cone 0, row 1] = -0.25", "friction must be >= 0");
  two_blocks(&batch, STICTION_F64);
  STICTION_CHECK_OK(stiction_validate(&batch, STICTION_SOLVER_NPGS));
  batch.A = NULL;
  STICTION_CHECK(stiction_solver_solve(solver, &batch, &solution, NULL, NULL) == STICTION_INVALID_ARGUMENT);
  STICTION_CHECK(stiction_verify(&batch, lambda, residual) == STICTION_INVALID_ARGUMENT);
  two_blocks(&batch, STICTION_F64);
  batch.env_row_offsets = NULL;
  STICTION_CHECK(stiction_solver_solve(solver, &batch, &solution, NULL, NULL) == STICTION_INVALID_ARGUMENT);
  two_blocks(&batch, STICTION_F64);
  batch.env_count = -1;
  STICTION_CHECK(stiction_solver_solve(solver, &batch, &solution, NULL, NULL) == STICTION_INVALID_ARGUMENT);
  solution.status = NULL;
  two_blocks(&batch, STICTION_F64);
  STICTION_CHECK_FAILS(stiction_solver_solve(solver, &batch, &solution, NULL, NULL), STICTION_INVALID_ARGUMENT,
                       "solution.status is null", "(2)");
  STICTION_CHECK_FAILS(stiction_hash(STICTION_F64, lambda, -3, &hash), STICTION_INVALID_ARGUMENT, "count = -3", ">= 0");
  STICTION_CHECK_FAILS(stiction_hash(STICTION_F64, NULL, 3, &hash), STICTION_INVALID_ARGUMENT, "values is null",
                       "array");
  STICTION_CHECK_FAILS(stiction_verify(&batch, NULL, residual), STICTION_INVALID_ARGUMENT, "lambda is null", "row");
  /* None of them wrote anything. */
  STICTION_CHECK(lambda[0] == 1 && lambda[5] == 6);
  STICTION_CHECK_OK(stiction_solver_destroy(solver));
}

/* Tickets: null, gone, of another kind, made up. */
static void handles(void) {
  stiction_solver *solver = NULL, *next = NULL;
  stiction_body_solver* bodies = NULL;
  char no_handle = 0;
  STICTION_CHECK_OK(stiction_solver_destroy(NULL));
  STICTION_CHECK_OK(stiction_batch_destroy(NULL));
  STICTION_CHECK_FAILS(stiction_solver_synchronize(NULL, NULL), STICTION_INVALID_ARGUMENT, "solver is null",
                       "stiction_solver_create");
  STICTION_CHECK_OK(stiction_solver_create("cpu", NULL, NULL, &solver));
  STICTION_CHECK_OK(stiction_solver_destroy(solver));
  STICTION_CHECK_OK(stiction_solver_create("cpu", NULL, NULL, &next));
  STICTION_CHECK(next != solver);
  STICTION_CHECK_FAILS(stiction_solver_synchronize(solver, NULL), STICTION_INVALID_ARGUMENT, "no live stiction_solver",
                       "destroyed");
  STICTION_CHECK_FAILS(stiction_solver_destroy(solver), STICTION_INVALID_ARGUMENT, "no live stiction_solver",
                       "destroyed");
  STICTION_CHECK_OK(stiction_body_solver_create("cpu", NULL, NULL, &bodies));
  STICTION_CHECK_FAILS(stiction_solver_synchronize((stiction_solver*)bodies, NULL), STICTION_INVALID_ARGUMENT,
                       "no live stiction_solver", "something else");
  STICTION_CHECK(stiction_solver_synchronize((stiction_solver*)&no_handle, NULL) == STICTION_INVALID_ARGUMENT);
  STICTION_CHECK_OK(stiction_solver_synchronize(next, NULL));
  STICTION_CHECK_OK(stiction_solver_destroy(next));
  STICTION_CHECK_OK(stiction_body_solver_destroy(bodies));
}

int main(void) {
  names();
  arguments();
  handles();
  return failures != 0;
}
