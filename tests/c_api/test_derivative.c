#include "check.h"

/* Sweeps over three rows that press on each other, in reverse, against differences of sweeps that are written here. */
enum { kRows = 3, kEntries = kRows * kRows, kSweeps = 3 };

static const double kA[kEntries] = {2, 0.5, -0.3, 0.5, 3, 0.2, -0.3, 0.2, 2.5}, kB[kRows] = {-1, -2, 1.5},
                    kR[kRows] = {0.1, 0.2, 0.1}, kZeros[kRows] = {0}, kStart[kRows] = {0.7, 0.1, 0.4},
                    kLoss[kRows] = {1, -2, 0.5};

/* The loss of the reactions after so many sweeps of projected Gauss-Seidel steps. */
static double loss_of(const double* A, const double* b, const double* R, const double* start) {
  double x[kRows], loss = 0;
  int sweep, i, j;
  memcpy(x, start, sizeof x);
  for (sweep = 0; sweep < kSweeps; ++sweep)
    for (i = 0; i < kRows; ++i) {
      double motion = b[i] + R[i] * x[i];
      for (j = 0; j < kRows; ++j) motion += A[kRows * i + j] * x[j];
      x[i] -= motion / (A[kRows * i + i] + R[i]);
      if (x[i] < 0) x[i] = 0;
    }
  for (i = 0; i < kRows; ++i) loss += kLoss[i] * x[i];
  return loss;
}

/* Change of the loss by one of the numbers, which is moved both ways and put back. */
static double slope(double* number, const double* A, const double* b, const double* R, const double* start) {
  const double step = 1e-6, held = *number;
  double up, down;
  *number = held + step;
  up = loss_of(A, b, R, start);
  *number = held - step;
  down = loss_of(A, b, R, start);
  *number = held;
  return (up - down) / (2 * step);
}

static int is_near(double value, double expected) {
  return value - expected <= 1e-8 && expected - value <= 1e-8;
}

static void pressed_rows(stiction_batch_view* batch) {
  static const int64_t ends[] = {0, kRows}, rows[] = {0, 1, 2, 3}, entries[] = {0, 3, 6, 9};
  static const uint8_t kinds[] = {STICTION_CONE_UNILATERAL, STICTION_CONE_UNILATERAL, STICTION_CONE_UNILATERAL};
  static const int32_t columns[] = {0, 1, 2, 0, 1, 2, 0, 1, 2};
  stiction_batch_view_init(batch, sizeof *batch);
  batch->precision = STICTION_F64;
  batch->law = STICTION_LAW_COULOMB;
  batch->env_count = 1;
  batch->cone_count = batch->row_count = kRows;
  batch->nonzero_count = kEntries;
  batch->env_row_offsets = batch->env_cone_offsets = ends;
  batch->cone_kind = kinds;
  batch->cone_row_offsets = rows;
  batch->row_offsets = entries;
  batch->column = columns;
  batch->A = kA;
  batch->b = kB;
  batch->R = kR;
  batch->mu = batch->lo = batch->hi = kZeros;
}

/* The result of the sweeps and all derivatives of the loss. On the emulated device, too, whose memory is the host's.
 */
static void sweeps_in_reverse(const char* device, int32_t space) {
  double A[kEntries], b[kRows], R[kRows], start[kRows];
  double by_A[kEntries], by_b[kRows], by_R[kRows], by_start[kRows], lambda[kRows], loss = 0;
  stiction_derivative* derivative = NULL;
  stiction_batch_view batch;
  stiction_capacity capacity;
  stiction_sweeps sweeps;
  stiction_solution_numbers from;
  stiction_batch_numbers to;
  stiction_gradient_status status;
  int k;
  memcpy(A, kA, sizeof A);
  memcpy(b, kB, sizeof b);
  memcpy(R, kR, sizeof R);
  memcpy(start, kStart, sizeof start);
  pressed_rows(&batch);
  STICTION_CHECK_OK(stiction_capacity_init(&capacity, sizeof capacity));
  STICTION_CHECK_OK(stiction_capacity_of(&batch, &capacity));
  batch.space = space;
  STICTION_CHECK_OK(stiction_derivative_create(device, NULL, &capacity, &derivative));
  STICTION_CHECK_OK(stiction_solution_numbers_init(&from, sizeof from));
  STICTION_CHECK_OK(stiction_batch_numbers_init(&to, sizeof to));
  STICTION_CHECK_OK(stiction_sweeps_init(&sweeps, sizeof sweeps));
  STICTION_CHECK(sweeps.count == 1 && sweeps.omega == 1 && sweeps.warm_start == NULL && sweeps.reserved == 0);
  sweeps.count = kSweeps;
  sweeps.warm_start = start;
  sweeps.lambda = lambda;
  sweeps.by_warm_start = by_start;
  from.lambda = (void*)kLoss;
  to.A = by_A;
  to.b = by_b;
  to.R = by_R;
  STICTION_CHECK_OK(stiction_derivative_unrolled_vjp(derivative, &batch, &sweeps, &from, &to, &status, 1, NULL));
  STICTION_CHECK_OK(stiction_derivative_synchronize(derivative, NULL));
  STICTION_CHECK(status.flags == 0);
  for (k = 0; k < kRows; ++k) loss += kLoss[k] * lambda[k];
  STICTION_CHECK(is_near(loss, loss_of(A, b, R, start)));
  STICTION_CHECK(by_start[0] != 0 || by_start[1] != 0 || by_start[2] != 0);
  for (k = 0; k < kEntries; ++k) STICTION_CHECK(is_near(by_A[k], slope(A + k, A, b, R, start)));
  for (k = 0; k < kRows; ++k) {
    STICTION_CHECK(is_near(by_b[k], slope(b + k, A, b, R, start)));
    STICTION_CHECK(is_near(by_R[k], slope(R + k, A, b, R, start)));
    STICTION_CHECK(is_near(by_start[k], slope(start + k, A, b, R, start)));
  }

  sweeps.omega = 2;
  STICTION_CHECK_FAILS(stiction_derivative_unrolled_vjp(derivative, &batch, &sweeps, &from, &to, &status, 1, NULL),
                       STICTION_INVALID_ARGUMENT, "sweeps.omega", "between 0 and 2");
  sweeps.omega = 1;
  sweeps.reserved = 1;
  STICTION_CHECK_FAILS(stiction_derivative_unrolled_vjp(derivative, &batch, &sweeps, &from, &to, &status, 1, NULL),
                       STICTION_INVALID_ARGUMENT, "sweeps.reserved", "0");
  sweeps.reserved = 0;
  from.velocity = (void*)kLoss;
  STICTION_CHECK_FAILS(stiction_derivative_unrolled_vjp(derivative, &batch, &sweeps, &from, &to, &status, 1, NULL),
                       STICTION_INVALID_ARGUMENT, "cotangents.velocity", "no velocities");
  STICTION_CHECK_OK(stiction_derivative_destroy(derivative));
}

int main(void) {
  sweeps_in_reverse("cpu", STICTION_SPACE_HOST);
  sweeps_in_reverse("emulated", STICTION_SPACE_CUDA);
  return failures != 0;
}
