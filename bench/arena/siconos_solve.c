/* Solves the environments of a binary file with one solver of Siconos and writes reactions and times.
 *
 *     siconos_solve SOLVER TOLERANCE MAX_ITERATIONS SECONDS IN OUT
 *
 * SOLVER: nsgs, admm, prox, nsn (friction), lemke, pgs (LCP). SECONDS of processor time for each environment. IN
 * (little-endian): int64 dimension of a contact (1: an LCP), int64 environments. For each environment:
 *
 * * int64 rows, int64 entries, int64 offsets[rows + 1], int64 columns[entries];
 * * double values[entries], double q[rows], double mu[rows / dimension].
 *
 * OUT has for each environment:
 *
 * * int64 how (0: Siconos calls it solved; > 0: its other return values; -1: out of time; -2: it crashed or could not
 *   treat it);
 * * double seconds within the driver, double reaction[rows] (NaN without an answer).
 *
 * Short solves are done again and the shortest counts.
 *
 * Each environment is solved in a separate process, so that neither a crash nor the clock costs the others. Built by
 * bench/arena/siconos.py where the headers are found: cc siconos_solve.c -lsiconos_numerics
 */
#include <math.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <siconos/numerics/FrictionContactProblem.h>
#include <siconos/numerics/Friction_cst.h>
#include <siconos/numerics/LinearComplementarityProblem.h>
#include <siconos/numerics/NonSmoothDrivers.h>
#include <siconos/numerics/NumericsMatrix.h>
#include <siconos/numerics/NumericsSparseMatrix.h>
#include <siconos/numerics/SolverOptions.h>
#include <siconos/numerics/SparseBlockMatrix.h>
#include <siconos/numerics/lcp_cst.h>

enum Storage { dense, blocks, triplets };

typedef struct {
  const char* name;
  int planar, spatial, lcp; /* identifiers of Siconos, 0: there is none */
  enum Storage storage;     /* the one that the solver reads fastest, or at all */
} Solver;

static const Solver solvers[] = {
    {"nsgs", SICONOS_FRICTION_2D_NSGS, SICONOS_FRICTION_3D_NSGS, 0, blocks},
    {"admm", 0, SICONOS_FRICTION_3D_ADMM, 0, triplets},
    {"prox", 0, SICONOS_FRICTION_3D_PROX, 0, triplets},
    {"nsn", 0, SICONOS_FRICTION_3D_NSN_AC, 0, triplets},
    {"lemke", SICONOS_FRICTION_2D_LEMKE, 0, SICONOS_LCP_LEMKE, dense},
    {"pgs", 0, 0, SICONOS_LCP_PGS, dense},
};

typedef struct {
  int64_t rows, entries, *offsets, *columns;
  double *values, *q, *mu;
} Problem;

/* Record that the child leaves for its parent. */
typedef struct {
  int64_t how;
  double seconds, reaction[];
} Answer;

static void fail(const char* what) {
  fprintf(stderr, "siconos_solve: %s\n", what);
  exit(2);
}

static void* take(FILE* in, size_t size, size_t count) {
  void* data = malloc(size * count + 1);
  if (!data || fread(data, size, count, in) != count) fail("the input ends early");
  return data;
}

static Problem read_problem(FILE* in, int64_t dimension) {
  Problem p;
  int64_t* head = take(in, sizeof *head, 2);
  p.rows = head[0], p.entries = head[1];
  free(head);
  p.offsets = take(in, sizeof *p.offsets, (size_t)p.rows + 1);
  p.columns = take(in, sizeof *p.columns, (size_t)p.entries);
  p.values = take(in, sizeof *p.values, (size_t)p.entries);
  p.q = take(in, sizeof *p.q, (size_t)p.rows);
  p.mu = take(in, sizeof *p.mu, (size_t)(p.rows / dimension));
  return p;
}

static NumericsMatrix* dense_matrix(const Problem* p) {
  NumericsMatrix* matrix = NM_create(NM_DENSE, (int)p->rows, (int)p->rows);
  memset(matrix->matrix0, 0, sizeof(double) * (size_t)(p->rows * p->rows));
  for (int64_t i = 0; i < p->rows; ++i)
    for (int64_t k = p->offsets[i]; k < p->offsets[i + 1]; ++k)
      matrix->matrix0[i + p->columns[k] * p->rows] += p->values[k];
  return matrix;
}

static NumericsMatrix* triplet_matrix(const Problem* p) {
  NumericsMatrix* matrix = NM_create(NM_SPARSE, (int)p->rows, (int)p->rows);
  NM_triplet_alloc(matrix, (CS_INT)p->entries);
  for (int64_t i = 0; i < p->rows; ++i)
    for (int64_t k = p->offsets[i]; k < p->offsets[i + 1]; ++k)
      NM_zentry(matrix, (int)i, (int)p->columns[k], p->values[k], 0.0);
  return matrix;
}

/* Blocks of one contact each, column by column inside, in order of their columns. */
static NumericsMatrix* block_matrix(const Problem* p, int d) {
  unsigned contacts = (unsigned)(p->rows / d);
  double** row_blocks = calloc(contacts, sizeof *row_blocks);
  SparseBlockStructuredMatrix* m = SBM_new();
  m->blocknumber0 = m->blocknumber1 = contacts;
  m->blocksize0 = malloc(contacts * sizeof *m->blocksize0);
  m->blocksize1 = malloc(contacts * sizeof *m->blocksize1);
  for (unsigned c = 0; c < contacts; ++c) m->blocksize0[c] = m->blocksize1[c] = (c + 1) * (unsigned)d;
  m->index1_data = calloc(contacts + 1, sizeof *m->index1_data);
  m->index2_data = malloc(((size_t)p->entries + contacts) * sizeof *m->index2_data);
  m->block = malloc(((size_t)p->entries + contacts) * sizeof *m->block);
  size_t used = 0;
  for (unsigned c = 0; c < contacts; ++c) {
    row_blocks[c] = calloc((size_t)(d * d), sizeof(double)); /* Siconos wants every diagonal block */
    for (int64_t i = (int64_t)c * d; i < (int64_t)(c + 1) * d; ++i)
      for (int64_t k = p->offsets[i]; k < p->offsets[i + 1]; ++k) {
        double** block = &row_blocks[p->columns[k] / d];
        if (!*block) *block = calloc((size_t)(d * d), sizeof(double));
        (*block)[i % d + p->columns[k] % d * d] += p->values[k];
      }
    for (unsigned other = 0; other < contacts; ++other)
      if (row_blocks[other]) {
        m->index2_data[used] = other;
        m->block[used++] = row_blocks[other];
        row_blocks[other] = NULL;
      }
    m->index1_data[c + 1] = used;
  }
  free(row_blocks);
  m->nbblocks = (unsigned)used;
  m->filled1 = contacts + 1;
  m->filled2 = used;
  return NM_new_SBM((int)p->rows, (int)p->rows, m);
}

static double seconds_of(clockid_t clock) {
  struct timespec now;
  clock_gettime(clock, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* Problem and options are made anew each time: drivers scale and work in their arguments. */
static void solve_once(const Problem* p, int d, const Solver* solver, double tolerance, int iterations,
                       Answer* answer) {
  enum Storage storage = solver->storage;
  NumericsMatrix* matrix = storage == dense    ? dense_matrix(p)
                           : storage == blocks ? block_matrix(p, d)
                                               : triplet_matrix(p);
  int id = d == 1 ? solver->lcp : d == 2 ? solver->planar : solver->spatial;
  SolverOptions* options = solver_options_create(id);
  options->iparam[SICONOS_IPARAM_MAX_ITER] = iterations;
  options->dparam[SICONOS_DPARAM_TOL] = tolerance;
  double* motion = calloc((size_t)p->rows, sizeof *motion);
  double* reaction = calloc((size_t)p->rows, sizeof *reaction);
  double wall, processor;
  if (d == 1) {
    LinearComplementarityProblem* problem = newLCP();
    problem->size = (int)p->rows, problem->M = matrix, problem->q = p->q;
    wall = seconds_of(CLOCK_MONOTONIC), processor = seconds_of(CLOCK_PROCESS_CPUTIME_ID);
    answer->how = linearComplementarity_driver(problem, reaction, motion, options);
  } else {
    FrictionContactProblem* problem = frictionContactProblem_new_with_data(d, (int)(p->rows / d), matrix, p->q, p->mu);
    wall = seconds_of(CLOCK_MONOTONIC), processor = seconds_of(CLOCK_PROCESS_CPUTIME_ID);
    answer->how =
        d == 2 ? fc2d_driver(problem, reaction, motion, options) : fc3d_driver(problem, reaction, motion, options);
  }
  wall = seconds_of(CLOCK_MONOTONIC) - wall;
  processor = seconds_of(CLOCK_PROCESS_CPUTIME_ID) - processor;
  /* The processor's clock leaves out other programs, and may tick once in 10 ms. */
  answer->seconds = wall > 0.1 ? fmin(wall, processor) : wall;
  memcpy(answer->reaction, reaction, sizeof(double) * (size_t)p->rows);
}

static void solve(const Problem* p, int d, const Solver* solver, double tolerance, int iterations, Answer* answer) {
  solve_once(p, d, solver, tolerance, iterations, answer);
  for (int repeat = 1; repeat < 3 && answer->seconds < 5e-3; ++repeat) {
    double best = answer->seconds;
    solve_once(p, d, solver, tolerance, iterations, answer);
    answer->seconds = fmin(best, answer->seconds);
  }
}

static void solve_apart(const Problem* p, int d, const Solver* solver, double tolerance, int iterations, double seconds,
                        FILE* out) {
  size_t size = sizeof(Answer) + sizeof(double) * (size_t)p->rows;
  Answer* answer = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (answer == MAP_FAILED) fail("no memory");
  fflush(out);
  pid_t child = fork();
  if (child < 0) fail("no process");
  if (child == 0) {
    struct rlimit limit = {(rlim_t)ceil(seconds), (rlim_t)ceil(seconds) + 1};
    setrlimit(RLIMIT_CPU, &limit);
    if (!freopen("/dev/null", "w", stdout) || !freopen("/dev/null", "w", stderr)) _exit(3);
    solve(p, d, solver, tolerance, iterations, answer);
    _exit(0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    int late = WIFSIGNALED(status) && (WTERMSIG(status) == SIGXCPU || WTERMSIG(status) == SIGKILL);
    answer->how = late ? -1 : -2;
    answer->seconds = seconds;
    for (int64_t i = 0; i < p->rows; ++i) answer->reaction[i] = NAN;
  }
  if (fwrite(answer, size, 1, out) != 1) fail("the output cannot be written");
  munmap(answer, size);
}

/* Parses an argument as a number. */
static double number(const char* text) {
  char* end;
  double value = strtod(text, &end);
  if (end == text || *end) fail("an argument is no number");
  return value;
}

int main(int count, char** words) {
  if (count != 7) fail("usage: siconos_solve SOLVER TOLERANCE MAX_ITERATIONS SECONDS IN OUT");
  const Solver* solver = NULL;
  for (size_t i = 0; i < sizeof solvers / sizeof *solvers; ++i)
    if (!strcmp(solvers[i].name, words[1])) solver = &solvers[i];
  if (!solver) fail("no such solver");
  FILE* in = fopen(words[5], "rb");
  FILE* out = fopen(words[6], "wb");
  if (!in || !out) fail("a file cannot be opened");
  int64_t* head = take(in, sizeof *head, 2);
  int d = (int)head[0];
  if (d < 1 || d > 3 || !(d == 1 ? solver->lcp : d == 2 ? solver->planar : solver->spatial))
    fail("this solver does not treat such contacts");
  for (int64_t e = 0; e < head[1]; ++e) {
    Problem p = read_problem(in, d);
    solve_apart(&p, d, solver, number(words[2]), (int)number(words[3]), number(words[4]), out);
    free(p.offsets), free(p.columns), free(p.values), free(p.q), free(p.mu);
  }
  return fclose(out) ? 2 : 0;
}
