#pragma once

/** \file
 * Numbers and structs of the C interface; included by stiction.h. Full description of the fields:
 * docs/reference/data_layout.md. */

#include <stddef.h>
#include <stdint.h>

#include "stiction_solver_kinds.h"

/** Raised when a program compiled before can no longer use the library. */
#define STICTION_ABI_VERSION 0

/** Result of a call. */
typedef enum stiction_code {
  STICTION_OK = 0,               /**< done */
  STICTION_INVALID_ARGUMENT = 1, /**< an argument is wrong; the text names it, its value and the remedy */
  STICTION_BAD_FILE = 2,         /**< a file is not of the kind it claims */
  STICTION_IO = 3,               /**< the operating system refused to read or write */
  STICTION_OUT_OF_MEMORY = 4,    /**< host or device memory */
  STICTION_NO_DEVICE = 5,        /**< the requested device is not there; the text says why */
  STICTION_DEVICE_FAILURE = 6,   /**< the device failed in a call; results of that call are not valid */
  STICTION_UNSUPPORTED = 7,      /**< this build lacks the feature; the text names the option that adds it */
  STICTION_INTERNAL = 8          /**< a fault of the library */
} stiction_code;

/** Type of the numbers of a batch. */
typedef enum stiction_precision {
  STICTION_F32 = 0, /**< float */
  STICTION_F64 = 1  /**< double */
} stiction_precision;
/** Memory in which arrays lie. */
typedef enum stiction_space {
  STICTION_SPACE_HOST = 0, /**< memory of the process */
  STICTION_SPACE_CUDA = 1  /**< memory of a CUDA device, or of the emulated one */
} stiction_space;

/** Kind of a cone; one byte each in cone_kind. */
typedef enum stiction_cone_kind {
  STICTION_CONE_FREE = 0,         /**< 1 row, w = 0 */
  STICTION_CONE_UNILATERAL = 1,   /**< 1 row, 0 <= lambda _|_ w >= 0 */
  STICTION_CONE_BOX = 2,          /**< 1 row, lo <= lambda <= hi */
  STICTION_CONE_FRICTION = 3,     /**< 2..6 rows, normal first: lambda_n >= norm(lambda_t / mu) */
  STICTION_CONE_BOX_FRICTION = 4, /**< 2..6 rows, normal first: |lambda_k| <= mu_k lambda_n on each further axis */
  STICTION_CONE_SEMIDEFINITE = 5  /**< 3 or 6 rows: a semidefinite matrix (docs/math/semidefinite.md) */
} stiction_cone_kind;

/** Law of the friction cones. */
typedef enum stiction_law {
  STICTION_LAW_OF_BATCH = -1, /**< in options alone: the batch's law */
  STICTION_LAW_CONVEX = 0,    /**< associated: lambda minimises a quadratic over the cones */
  STICTION_LAW_COULOMB = 1,   /**< exact Coulomb law */
  STICTION_LAW_BOXED = 2      /**< in body options alone: boxed friction (docs/math/box_friction.md) */
} stiction_law;

/** Policy for an environment whose numbers break a precondition. */
typedef enum stiction_invalid_policy {
  STICTION_INVALID_REJECT = 0, /**< the call fails before anything is changed */
  STICTION_INVALID_ISOLATE = 1 /**< that environment is flagged and gets zeros; the others are solved */
} stiction_invalid_policy;

/** Iteration of an environment's islands (docs/howto/islands.md). */
typedef enum stiction_islands {
  STICTION_ISLANDS_TOGETHER = 0, /**< as one system */
  STICTION_ISLANDS_APART = 1     /**< each as an environment of its own would be */
} stiction_islands;

/** Choice of an environment's solver (docs/howto/spectrum.md). */
typedef enum stiction_choice {
  STICTION_CHOICE_NAMED = 0,   /**< by the field solver */
  STICTION_CHOICE_SPECTRUM = 1 /**< by condition and density of its operator, then auto where that falls short */
} stiction_choice;

/** Contents of the mass array of a Jacobian batch. */
typedef enum stiction_mass_form {
  STICTION_MASS_MATRIX = 0, /**< M itself, symmetric positive definite */
  STICTION_MASS_FACTOR = 1  /**< the lower Cholesky factor L of M = L L' */
} stiction_mass_form;
/** Which environments of a Jacobian batch keep A as a factor. */
typedef enum stiction_factor_use {
  STICTION_FACTOR_NEVER = 0,   /**< none */
  STICTION_FACTOR_BY_SIZE = 1, /**< those of many rows and few degrees of freedom (docs/howto/jacobian.md) */
  STICTION_FACTOR_ALWAYS = 2   /**< all that have degrees of freedom */
} stiction_factor_use;

/** Method that solves bodies (docs/howto/bodies.md). */
typedef enum stiction_body_method {
  STICTION_BODY_IMPULSES = 0, /**< sequential impulses */
  STICTION_BODY_NEWTON = 1    /**< inexact Newton's method on the bodies' velocities */
} stiction_body_method;

/** Preconditioner of the linear systems of Newton's method (docs/math/preconditioners.md). */
typedef enum stiction_body_preconditioner {
  STICTION_PRECONDITIONER_DIAGONAL = 0,            /**< diagonal of the matrix */
  STICTION_PRECONDITIONER_BLOCK_DIAGONAL = 1,      /**< each body by itself */
  STICTION_PRECONDITIONER_INCOMPLETE_CHOLESKY = 2, /**< a factor without fill; for CPUs */
  STICTION_PRECONDITIONER_SPARSE_INVERSE = 3,      /**< factored approximate inverse on the graph of bodies */
  STICTION_PRECONDITIONER_FACTOR = 4,              /**< the whole factor: a direct solve */
  STICTION_PRECONDITIONER_MULTIGRID = 5            /**< aggregates of bodies that move rigidly */
} stiction_body_preconditioner;

/** Map from a coarse body's motion to that of its members (docs/math/multigrid.md). */
typedef enum stiction_prolongation {
  STICTION_PROLONGATION_PLAIN = 0,   /**< rigidly */
  STICTION_PROLONGATION_SMOOTHED = 1 /**< rigidly, then one damped block-Jacobi step */
} stiction_prolongation;
/** Times that a cycle visits a coarser level for each visit of the finer one. */
typedef enum stiction_cycle {
  STICTION_CYCLE_V = 1, /**< once */
  STICTION_CYCLE_W = 2  /**< twice */
} stiction_cycle;

/** In which order a factorisation eliminates rows (docs/math/preconditioners.md). */
typedef enum stiction_ordering {
  STICTION_ORDERING_NATURAL = 0,                    /**< as the rows are numbered */
  STICTION_ORDERING_REVERSE_CUTHILL_MCKEE = 1,      /**< narrow bands */
  STICTION_ORDERING_MINIMUM_DEGREE = 2,             /**< approximate minimum degree, Eigen's */
  STICTION_ORDERING_SUITESPARSE_MINIMUM_DEGREE = 3, /**< AMD of SuiteSparse */
  STICTION_ORDERING_NESTED_DISSECTION = 4           /**< METIS, with a fixed seed */
} stiction_ordering;

/** Effect of a change of the time step on a stored reaction (docs/howto/warm_start.md). */
typedef enum stiction_step_scaling {
  STICTION_STEP_CAPPED = 0,      /**< min(1, dt_prev / dt) */
  STICTION_STEP_NONE = 1,        /**< 1 */
  STICTION_STEP_PROPORTIONAL = 2 /**< dt / dt_prev */
} stiction_step_scaling;

/** Outcome of the solve of one environment. */
typedef enum stiction_env_code {
  STICTION_ENV_SOLVED = 0,         /**< residual finite and at most the tolerance */
  STICTION_ENV_MAX_ITERATIONS = 1, /**< iteration limit reached; the best iterate is returned */
  STICTION_ENV_STALLED = 2,        /**< no progress; the best iterate is returned */
  STICTION_ENV_NUMERICAL = 3,      /**< the iteration left the finite numbers; the best finite iterate is returned */
  STICTION_ENV_INVALID_INPUT = 4,  /**< see the flags; lambda = 0 and w = 0 are returned */
  STICTION_ENV_UNSUPPORTED = 5,    /**< the solver cannot treat this system; lambda = 0, w = b */
  STICTION_ENV_ROUNDING = 6,       /**< above the tolerance, and roundings of the reactions are all that is left */
  STICTION_ENV_INFEASIBLE = 7      /**< solved but for contacts that cannot move, which carry nothing */
} stiction_env_code;

/** Flags of one environment; any number of bits at once. */
typedef enum stiction_env_flag {
  STICTION_FLAG_NON_FINITE_INPUT = 1 << 0,    /**< NaN or infinity in A, b, R or mu, or NaN in a bound */
  STICTION_FLAG_NEGATIVE_FRICTION = 1 << 1,   /**< some mu < 0 */
  STICTION_FLAG_CROSSED_BOUNDS = 1 << 2,      /**< some lo > hi */
  STICTION_FLAG_NEGATIVE_COMPLIANCE = 1 << 3, /**< some R < 0 */
  STICTION_FLAG_BAD_DIAGONAL = 1 << 4,        /**< a diagonal of A + R that no contact has */
  STICTION_FLAG_WARM_START_REJECTED = 1 << 5, /**< the warm start or its square was not finite; started from zero */
  STICTION_FLAG_ASYMMETRIC = 1 << 6,        /**< A differs from its transpose by more than 1e-2 of its largest entry */
  STICTION_FLAG_CONTACTS_DROPPED = 1 << 7,  /**< more contacts than room; solved with those that are there */
  STICTION_FLAG_BAD_MASS = 1 << 8,          /**< a mass matrix that is not positive definite, or not finite */
  STICTION_FLAG_OVER_CAPACITY = 1 << 9,     /**< larger than the solver's capacity; not solved */
  STICTION_FLAG_BAD_STRUCTURE = 1 << 10,    /**< offsets, cones or columns out of order or range; not solved */
  STICTION_FLAG_UNSUPPORTED_CONE = 1 << 11, /**< a cone that the solver cannot treat; not solved */
  STICTION_FLAG_RAY = 1 << 12,              /**< lemke ended on a ray: it found no solution */
  STICTION_FLAG_IMMOVABLE = 1 << 13         /**< a row of A + R that is zero and that its law asks to move */
} stiction_env_flag;

typedef struct stiction_solver stiction_solver;                   /**< solves contact batches */
typedef struct stiction_jacobian_solver stiction_jacobian_solver; /**< solves Jacobian batches */
typedef struct stiction_body_solver stiction_body_solver;         /**< solves bodies and contact points */
typedef struct stiction_stepping_solver stiction_stepping_solver; /**< one of these and a store of reactions */
typedef struct stiction_batch stiction_batch;                     /**< a batch that was read from a file */

/* ---- Records. Arrays of them are shared with the device, so they have no size field and do not grow. ---- */

/** The record every environment gets. 32 bytes. */
typedef struct stiction_status {
  double residual;          /**< largest error of a contact over its island's scale (docs/math/residual.md) [-] */
  double residual_absolute; /**< largest error of a contact [w] */
  uint32_t flags;           /**< stiction_env_flag bits */
  int32_t iterations;       /**< of the solver that answered */
  uint8_t code;             /**< stiction_env_code */
  uint8_t solver;           /**< stiction_solver_kind that answered */
  uint8_t reserved[2];      /**< zero */
  int32_t islands;          /**< that were solved apart (STICTION_ISLANDS_APART); 0: none was */
} stiction_status;

/** Errors of the contacts of an environment (docs/math/residual.md). */
typedef struct stiction_residual {
  double relative; /**< largest error of a contact / scale of its island [-] */
  double absolute; /**< largest error of a contact [w] */
} stiction_residual;

/** The contact of an environment whose error has the largest share of its island's scale. */
typedef struct stiction_worst_contact {
  double error;     /**< its error [w] */
  double scale;     /**< its island's scale [w] */
  int32_t cone;     /**< counted within the environment, -1: no contact has an error */
  int32_t reserved; /**< zero */
} stiction_worst_contact;

/** Record of a stepping solver's store for one environment. 16 bytes. */
typedef struct stiction_warm_start_record {
  int32_t hits;       /**< cones of the last step that started from a stored reaction */
  int32_t misses;     /**< cones of the last step that started from zero */
  uint32_t flags;     /**< WarmStartFlag bits (docs/howto/warm_start.md) */
  uint32_t too_large; /**< steps in which it did not fit */
} stiction_warm_start_record;

/* ---- Options ---- */

/** Options of a solver. */
typedef struct stiction_solver_options {
  size_t size;            /**< sizeof of the struct that the caller has */
  double tolerance;       /**< on the relative residual; 0: all iterations [-] */
  double omega;           /**< relaxation of pgs and npgs, in (0, 2) [-] */
  int32_t solver;         /**< stiction_solver_kind */
  int32_t law;            /**< stiction_law */
  int32_t max_iterations; /**< per environment, >= 0 */
  int32_t stall_window;   /**< stop after that many iterations without a better residual; 0: never */
  int32_t threads;        /**< of the CPU; 0: all cores */
  int32_t invalid;        /**< stiction_invalid_policy */
  int32_t islands;        /**< stiction_islands */
  int32_t direct_rows;    /**< rows of the largest environment that is factorised, 1024 to 32768; CPU only, not auto */
  double absolute_tolerance; /**< on the absolute residual; solved is where either holds [w] */
  int32_t choose;            /**< stiction_choice */
  int32_t reserved;          /**< zero */
} stiction_solver_options;

/** Room that a solver on a GPU takes when it is made; zero: as the batches need it. */
typedef struct stiction_capacity {
  size_t size;          /**< sizeof of the struct that the caller has */
  int64_t envs;         /**< environments of a batch */
  int64_t rows;         /**< rows of a batch */
  int64_t cones;        /**< cones of a batch */
  int64_t nonzeros;     /**< stored entries of A of a batch */
  int64_t env_nonzeros; /**< entries of the environment with the most */
  int32_t env_rows;     /**< rows of the largest environment */
  int32_t env_dofs;     /**< columns of the widest factor */
  int32_t precision;    /**< stiction_precision, the widest that batches will have; of a stepping solver: the one */
  int32_t semidefinite; /**< 1: cones of semidefinite will come; 0: none */
} stiction_capacity;

/** Options of the store of a stepping solver. */
typedef struct stiction_warm_start_options {
  size_t size;     /**< sizeof of the struct that the caller has */
  double beta;     /**< part of the last reaction to start from, in (0, 1] [-] */
  int32_t scaling; /**< stiction_step_scaling */
  int32_t threads; /**< of the CPU; 0: all cores */
} stiction_warm_start_options;

/* ---- Contact batches: (A + diag R) lambda + b = w in every environment ---- */

/** Rows of all environments follow one another; columns of A count from the environment's own. "or null": optional. */
typedef struct stiction_batch_view {
  size_t size;                       /**< sizeof of the struct that the caller has */
  int32_t precision;                 /**< stiction_precision of A, factor, b, R, mu, lo, hi and of the solution */
  int32_t space;                     /**< stiction_space of all arrays */
  int32_t law;                       /**< stiction_law */
  int32_t normal_last;               /**< nonzero: friction cones have their normal row last */
  int64_t env_count;                 /**< environments */
  int64_t cone_count;                /**< cones of all environments */
  int64_t row_count;                 /**< rows of all environments */
  int64_t nonzero_count;             /**< stored entries of all A */
  const int64_t* env_row_offsets;    /**< first row of each environment (env_count + 1) */
  const int64_t* env_cone_offsets;   /**< first cone of each environment (env_count + 1) */
  const int32_t* env_row_counts;     /**< rows in use, or null: all (env_count) */
  const int32_t* env_cone_counts;    /**< cones in use, or null: all (env_count) */
  const uint32_t* env_flags;         /**< stiction_env_flag bits found by the batch's maker, or null (env_count) */
  const double* env_tolerance;       /**< in place of the option; below zero or NaN: the option; or null (env_count) */
  const int32_t* env_max_iterations; /**< in place of the option; below zero: the option; or null (env_count) */
  const uint8_t* cone_kind;          /**< stiction_cone_kind (cone_count) */
  const int64_t* cone_row_offsets;   /**< first row of each cone (cone_count + 1) */
  const int32_t* cone_group;         /**< manifold of each cone, -1: none; or null (cone_count) */
  const int64_t* row_offsets;        /**< CSR rows of A (row_count + 1) */
  const int32_t* row_counts;         /**< entries in use of each row, or null: all (row_count) */
  const int32_t* column;             /**< CSR columns within the environment (nonzero_count) */
  const int64_t* column_offsets;     /**< first column of each row where rows share columns, or null (row_count) */
  int64_t column_count;              /**< length of column where column_offsets is given */
  const void* A;                     /**< Delassus operator without R [w / lambda] (nonzero_count) */
  const int64_t* factor_offsets;     /**< first entry of Y of each environment, A = Y Y', or null (env_count + 1) */
  const void* factor;                /**< Y, row-major, rows x dofs, or null (factor_count) */
  int64_t factor_count;              /**< length of factor */
  const void* b;                     /**< right-hand side [w] (row_count) */
  const void* R;                     /**< compliance, >= 0 [w / lambda] (row_count) */
  const void* mu;                    /**< friction on a friction cone's tangential rows [-] (row_count) */
  const int64_t* mu_offsets;         /**< where in mu the friction of each row is, or null: at the row (row_count) */
  int64_t mu_count;                  /**< length of mu where mu_offsets is given */
  const void* lo;                    /**< lower bound of box rows; -1e20 and below: none [lambda] (row_count) */
  const void* hi;                    /**< upper bound of box rows; 1e20 and above: none [lambda] (row_count) */
} stiction_batch_view;

/** Outputs of a solve; memory and precision are the batch's. */
typedef struct stiction_solution {
  size_t size;             /**< sizeof of the struct that the caller has */
  void* lambda;            /**< reactions [lambda] (row_count) */
  void* w;                 /**< residual motion [w], or null (row_count) */
  stiction_status* status; /**< (env_count) */
} stiction_solution;

/* ---- Jacobian batches: A = J M^-1 J', b = J v_free - target ---- */

/** Room that a solver of Jacobian batches takes when it is made. */
typedef struct stiction_jacobian_capacity {
  size_t size;          /**< sizeof of the struct that the caller has */
  int64_t envs;         /**< environments of a batch */
  int64_t rows;         /**< rows of a batch */
  int64_t cones;        /**< cones of a batch */
  int64_t matrix;       /**< entries of all A together */
  int64_t factor;       /**< entries of all factors together */
  int32_t env_rows;     /**< rows of the largest environment */
  int32_t env_dofs;     /**< degrees of freedom of the largest */
  int32_t precision;    /**< stiction_precision of the batches */
  int32_t factor_use;   /**< stiction_factor_use; it reaches the last bits of the answer */
  int32_t semidefinite; /**< 1: cones of semidefinite will come; 0: none */
  int32_t reserved;     /**< zero */
} stiction_jacobian_capacity;

/** Constraint Jacobian J, mass matrix M, velocities of many environments; rows and cones as in stiction_batch_view. */
typedef struct stiction_jacobian_view {
  size_t size;                       /**< sizeof of the struct that the caller has */
  int32_t precision;                 /**< stiction_precision of all Real arrays */
  int32_t space;                     /**< stiction_space of all arrays */
  int32_t law;                       /**< stiction_law */
  int32_t mass_form;                 /**< stiction_mass_form */
  int32_t mass_block;                /**< rows of the blocks of M; 0: M is one block */
  int32_t reserved;                  /**< zero */
  int64_t env_count;                 /**< environments */
  int64_t cone_count;                /**< cones of all environments */
  int64_t row_count;                 /**< rows of all environments */
  int64_t dof_count;                 /**< degrees of freedom of all environments */
  int64_t entry_count;               /**< length of J */
  int64_t mass_count;                /**< length of M */
  const int64_t* env_row_offsets;    /**< (env_count + 1) */
  const int64_t* env_cone_offsets;   /**< (env_count + 1) */
  const int64_t* env_dof_offsets;    /**< (env_count + 1) */
  const int64_t* env_mass_offsets;   /**< first entry of M of each environment (env_count + 1) */
  const int32_t* env_row_counts;     /**< as in stiction_batch_view, or null (env_count) */
  const int32_t* env_cone_counts;    /**< as in stiction_batch_view, or null (env_count) */
  const uint32_t* env_flags;         /**< as in stiction_batch_view, or null (env_count) */
  const double* env_tolerance;       /**< as in stiction_batch_view, or null (env_count) */
  const int32_t* env_max_iterations; /**< as in stiction_batch_view, or null (env_count) */
  const uint8_t* cone_kind;          /**< stiction_cone_kind (cone_count) */
  const int64_t* cone_row_offsets;   /**< (cone_count + 1) */
  const int32_t* cone_group;         /**< as in stiction_batch_view, or null (cone_count) */
  const int64_t* row_offsets;        /**< first entry of J of each row (row_count + 1) */
  const int32_t* column;             /**< degree of freedom of each entry, or null: dense rows (entry_count) */
  const void* J;                     /**< constraint Jacobian [w / v] (entry_count) */
  const void* M;                     /**< blocks, row-major, lower triangles [lambda w / v^2] (mass_count) */
  const void* v_free;                /**< velocity without reactions [v] (dof_count) */
  const void* target;                /**< motion that rows aim at [w], or null: zeros (row_count) */
  const void* R;                     /**< compliance, >= 0 [w / lambda] (row_count) */
  const void* mu;                    /**< friction per axis (row_count) */
  const void* lo;                    /**< bounds of box rows [lambda] (row_count) */
  const void* hi;                    /**< (row_count) */
} stiction_jacobian_view;

/** Outputs of a solve of a Jacobian batch; memory and precision are the batch's. */
typedef struct stiction_jacobian_solution {
  size_t size;             /**< sizeof of the struct that the caller has */
  void* lambda;            /**< reactions [lambda] (row_count) */
  void* w;                 /**< residual motion [w], or null (row_count) */
  void* velocity;          /**< v_free + M^-1 J' lambda [v], or null (dof_count) */
  stiction_status* status; /**< (env_count) */
} stiction_jacobian_solution;
