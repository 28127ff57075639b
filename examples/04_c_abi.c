#include <stdio.h>
#include <stiction.h>

/* Two blocks of 1 kg on the floor, pushed sideways by 2 N and 6 N; mu = 0.5. */
int main(void) {
  const int64_t env_rows[] = {0, 3, 6}, env_cones[] = {0, 1, 2}, cone_rows[] = {0, 3, 6};
  const int64_t rows[] = {0, 1, 2, 3, 4, 5, 6};
  const uint8_t kinds[] = {STICTION_CONE_FRICTION, STICTION_CONE_FRICTION};
  const int32_t columns[] = {0, 1, 2, 0, 1, 2}; /* A is the identity: only its diagonal is stored */
  const double A[] = {1, 1, 1, 1, 1, 1}, b[] = {-9.81, 2, 0, -9.81, 6, 0}, mu[] = {0, 0.5, 0.5, 0, 0.5, 0.5};
  const double none[6] = {0};
  double lambda[6], w[6];
  stiction_status status[2];
  stiction_solver* solver = NULL;
  stiction_batch_view batch;
  stiction_solution solution;
  int e;

  stiction_batch_view_init(&batch, sizeof batch);
  batch.precision = STICTION_F64;
  batch.law = STICTION_LAW_COULOMB;
  batch.env_count = 2, batch.cone_count = 2, batch.row_count = 6, batch.nonzero_count = 6;
  batch.env_row_offsets = env_rows, batch.env_cone_offsets = env_cones;
  batch.cone_kind = kinds, batch.cone_row_offsets = cone_rows;
  batch.row_offsets = rows, batch.column = columns, batch.A = A;
  batch.b = b, batch.R = none, batch.mu = mu, batch.lo = none, batch.hi = none;

  stiction_solution_init(&solution, sizeof solution);
  solution.lambda = lambda, solution.w = w, solution.status = status;

  if (stiction_solver_create("cpu", NULL, NULL, &solver) != STICTION_OK ||
      stiction_solver_solve(solver, &batch, &solution, NULL, NULL) != STICTION_OK) {
    fprintf(stderr, "%s\n", stiction_last_error());
    return 1;
  }
  for (e = 0; e < 2; ++e)
    printf("normal %.3f N, friction %.3f N, slides at %.3f m/s2: %s\n", lambda[3 * e], lambda[3 * e + 1], w[3 * e + 1],
           stiction_env_code_name(status[e].code));
  stiction_solver_destroy(solver);
  return 0;
}
