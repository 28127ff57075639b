#pragma once

/** \file
 * Structs of bodies; included by stiction.h. Full description: docs/howto/bodies.md. */

#include <stddef.h>
#include <stdint.h>

#include "stiction_structs.h"

/** Conversion of a step to b and R (docs/howto/bodies.md). */
typedef struct stiction_time_stepping {
  size_t size;                  /**< sizeof of the struct that the caller has */
  double dt;                    /**< the step, > 0 [s] */
  double erp;                   /**< share of a penetration undone in one step, in [0, 1] [-] */
  double slop;                  /**< penetration left alone, >= 0 [m] */
  double cfm;                   /**< velocity a contact yields per force, >= 0 [m/(N s)] */
  double restitution_threshold; /**< slower approach does not bounce, >= 0 [m/s] */
} stiction_time_stepping;

/** Options of a body solver. */
typedef struct stiction_body_options {
  size_t size;                  /**< sizeof of the struct that the caller has */
  double tolerance;             /**< on the relative residual; 0: all iterations [-] */
  double omega;                 /**< relaxation, in (0, 2) [-] */
  int32_t law;                  /**< stiction_law */
  int32_t method;               /**< stiction_body_method */
  int32_t iterations;           /**< sweeps or Newton steps of each sub-step, at most, >= 0 */
  int32_t momentum;             /**< nonzero: Nesterov's, for sweeps */
  int32_t substeps;             /**< >= 1 */
  int32_t max_contacts_per_env; /**< 0: no limit; else the deepest are solved */
  int32_t threads;              /**< of the CPU; 0: all cores */
  int32_t invalid;              /**< stiction_invalid_policy */
  int32_t preconditioner;       /**< stiction_body_preconditioner, for Newton's method; so are those below */
  int32_t prolongation;         /**< stiction_prolongation */
  int32_t cycle;                /**< stiction_cycle */
  int32_t ordering;             /**< stiction_ordering */
  double absolute_tolerance;    /**< on the absolute residual; solved is where either holds [m/s] */
} stiction_body_options;

/** Bodies and contact points. World axes; a twist is (velocity of the centre of mass [m/s], angular velocity [rad/s]).
 * Body numbers count from the environment's first body; -1 is the world. */
typedef struct stiction_body_view {
  size_t size;                        /**< sizeof of the struct that the caller has */
  int32_t precision;                  /**< stiction_precision of all Real arrays */
  int32_t space;                      /**< stiction_space of all arrays */
  int64_t env_count;                  /**< environments */
  int64_t body_count;                 /**< bodies of all environments */
  int64_t contact_count;              /**< contacts of all environments */
  const int64_t* env_body_offsets;    /**< (env_count + 1) */
  const int64_t* env_contact_offsets; /**< (env_count + 1) */
  const void* inv_mass;               /**< [1/kg] (body_count) */
  const void* inv_inertia;            /**< xx, xy, xz, yy, yz, zz [1/(kg m^2)] (6 * body_count) */
  const void* twist;                  /**< at the beginning of the step (6 * body_count) */
  const void* twist_change;           /**< by all forces but contact over the step, or null (6 * body_count) */
  const uint8_t* kinematic;           /**< nonzero: moves by `twist`, or null (body_count) */
  const int32_t* body_a;              /**< (contact_count) */
  const int32_t* body_b;              /**< (contact_count) */
  const void* arm_a;                  /**< contact point from a's centre of mass [m] (3 * contact_count) */
  const void* arm_b;                  /**< contact point from b's centre of mass [m] (3 * contact_count) */
  const void* normal;                 /**< unit vector from a to b (3 * contact_count) */
  const void* mu;                     /**< friction, >= 0 [-] (contact_count) */
  const void* depth;                  /**< penetration; negative: a gap [m] (contact_count) */
  const void* restitution;            /**< in [0, 1] [-] (contact_count) */
} stiction_body_view;

/** Outputs of a solve of bodies; memory and precision are the batch's. */
typedef struct stiction_body_solution {
  size_t size;             /**< sizeof of the struct that the caller has */
  void* impulse;           /**< (normal, tangent 1, tangent 2) on b [N s] (3 * contact_count) */
  void* twist;             /**< after the step (6 * body_count) */
  void* w;                 /**< residual motion of the last sub-step [m/s], or null (3 * contact_count) */
  stiction_status* status; /**< (env_count) */
} stiction_body_solution;
