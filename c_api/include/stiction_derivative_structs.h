#pragma once

/** \file
 * Structs of derivatives; included by stiction.h. Full description: docs/math/derivative.md. */

#include <stddef.h>
#include <stdint.h>

#include "stiction_structs.h"

/** Flags of the derivative of one environment; the first five come with zeros. */
typedef enum stiction_gradient_flag {
  STICTION_GRADIENT_INVALID_INPUT = 1 << 0,   /**< numbers or flags that forbid a solve */
  STICTION_GRADIENT_UNCONVERGED = 1 << 1,     /**< not solved, or its residual is above the limit */
  STICTION_GRADIENT_NON_FINITE = 1 << 2,      /**< a reaction, cotangent or tangent is not finite, or a result */
  STICTION_GRADIENT_SINGULAR = 1 << 3,        /**< redundant contacts without compliance */
  STICTION_GRADIENT_OVER_CAPACITY = 1 << 4,   /**< more unknowns than max_unknowns */
  STICTION_GRADIENT_UNSTABLE_BRANCH = 1 << 5, /**< a sliding contact that pressure presses on less */
  STICTION_GRADIENT_SUBGRADIENT = 1 << 6,     /**< a contact is between two modes */
  STICTION_GRADIENT_BAD_STRUCTURE = 1 << 7    /**< found on a device: nothing but the record is written */
} stiction_gradient_flag;

typedef struct stiction_derivative stiction_derivative; /**< differentiates batches */

/** The record every environment gets with its derivative. 32 bytes. */
typedef struct stiction_gradient_status {
  double residual;         /**< of the linear system, relative; the largest of all sets [-] */
  double forward_residual; /**< largest error of the reactions over the largest island's scale [-] */
  uint32_t flags;          /**< stiction_gradient_flag bits */
  int32_t unknowns;        /**< rows of the linear system */
  int32_t degenerate;      /**< cones between two modes */
  uint32_t reserved;       /**< zero */
} stiction_gradient_status;

/** Options of a derivative. */
typedef struct stiction_derivative_options {
  size_t size;           /**< sizeof of the struct that the caller has */
  double residual_limit; /**< reactions of a larger relative residual get zeros [-] */
  double tie_tolerance;  /**< a cone this close to another mode, over max|b|, is degenerate [-] */
  int32_t law;           /**< stiction_law */
  int32_t max_unknowns;  /**< of an environment */
  int32_t threads;       /**< of the CPU; 0: all cores */
  int32_t reserved;      /**< zero */
  double kappa;          /**< reaction times motion of the problem that is differentiated; 0: exact [lambda w] */
} stiction_derivative_options;

/** Numbers that belong to a solution, set after set: cotangents that are read, or changes that are written. Null:
 * zeros, or not wanted. */
typedef struct stiction_solution_numbers {
  size_t size;    /**< sizeof of the struct that the caller has */
  void* lambda;   /**< (count * row_count) */
  void* w;        /**< (count * row_count) */
  void* velocity; /**< of Jacobian batches alone (count * dof_count) */
} stiction_solution_numbers;

/** Sweeps of solver `pgs` that are differentiated as they run, and derivatives beside the batch's cotangents. */
typedef struct stiction_sweeps {
  size_t size;            /**< sizeof of the struct that the caller has */
  const void* warm_start; /**< where they begin; null: at zero (row_count) */
  void* lambda;           /**< out: the answer of so many sweeps; null: not wanted (row_count) */
  void* by_warm_start;    /**< out, set after set: by the warm start; null: not wanted (count of sets * row_count) */
  double omega;           /**< as of the solver [-] */
  int32_t count;          /**< sweeps */
  int32_t reserved;       /**< zero */
} stiction_sweeps;

/** Numbers that belong to a contact batch, set after set: changes that are read, or cotangents that are written. Null:
 * zeros, or not wanted. */
typedef struct stiction_batch_numbers {
  size_t size;  /**< sizeof of the struct that the caller has */
  void* A;      /**< stored entries, each by itself (count * nonzero_count) */
  void* factor; /**< Y where A = Y Y' (count * factor_count) */
  void* b;      /**< (count * row_count) */
  void* R;      /**< (count * row_count) */
  void* mu;     /**< of each row (count * row_count) */
  void* lo;     /**< (count * row_count) */
  void* hi;     /**< (count * row_count) */
} stiction_batch_numbers;

/** Numbers that belong to a Jacobian batch, set after set: changes that are read, or cotangents that are written. Null:
 * zeros, or not wanted. */
typedef struct stiction_jacobian_numbers {
  size_t size;  /**< sizeof of the struct that the caller has */
  void* J;      /**< stored entries (count * entry_count) */
  void* M;      /**< symmetric, or its symmetric part; of a factor its lower triangle (count * mass_count) */
  void* v_free; /**< (count * dof_count) */
  void* target; /**< (count * row_count) */
  void* R;      /**< (count * row_count) */
  void* mu;     /**< of each row (count * row_count) */
  void* lo;     /**< (count * row_count) */
  void* hi;     /**< (count * row_count) */
} stiction_jacobian_numbers;
