#pragma once

#include "core/algorithm/articulated/spatial.hpp"
#include "core/algorithm/velocity/lanes/lane_array.hpp"
#include "core/algorithm/velocity/lanes/tree_factor.hpp"
#include "core/job/articulated_job.hpp"

/// Numbers of the robots in the lanes of a vector, one array for each quantity.
namespace stiction::inline STICTION_ISA {

/// The tree of a model's degrees of freedom: pairs coupled by M.
using RobotTree = DofTree<DofSet>;

/// coupled[k]: the degree of freedom before k on the way to the root  (dof_count).
template <class T>
STICTION_HD void couple_robot(const ArticulatedModelView<T>& model, DofSet* coupled) {
  for (Index k = 0; k < model.dof_count; ++k) {
    const Index parent = model.dof[k].parent;
    coupled[k] = parent < 0 ? DofSet{} : only<DofSet>(parent);
  }
}
template <class T>
STICTION_HD void build_robot_tree(const ArticulatedModelView<T>& model, RobotTree& tree) {
  DofSet coupled[kMostArticulatedDofs];
  couple_robot(model, coupled);
  SerialTeam alone;
  build_tree<SerialTeam, 1, DofSet>(alone, tree, model.dof_count, coupled, nullptr, 0);
}

/// Takes arrays from memory, one after another at multiples of 64 bytes, or measures them where there is none.
struct ArrayTaker {
  char* memory;
  Offset used = 0;

  template <class Element>
  STICTION_HD void operator()(Element*& array, Index count) {
    if (memory != nullptr) array = reinterpret_cast<Element*>(memory + used);
    used += (static_cast<Offset>(count) * static_cast<Offset>(sizeof(Element)) + 63) / 64 * 64;
  }
};

template <class Real>
struct RobotWorkspace {
  using T = Scalar<Real>;
  using Numbers = LaneArray<Real, RealTraits<Real>::kLanes>;

  Real *qpos, *qvel, *ctrl, *applied;   ///< state, and forces on it
  Real *first_qpos, *first_qvel;        ///< where a step of several stages began
  Real* rate;                           ///< of coordinates, as its stages add them up      (dofs)
  Real *sum_rate, *sum_qacc;            ///< of its stages                                 (dofs)
  Vector3<Real>* position;              ///< of bodies                                     (bodies)
  Quaternion<Real>* orientation;        ///<                                               (bodies)
  Axes3<Real>* axes;                    ///< the same as axes                              (bodies)
  Vector3<Real>* centre;                ///< of mass                                       (bodies)
  Vector3<Real>* tree_centre;           ///< of the whole tree, where its root is          (bodies)
  SpatialInertia<Real>* inertia;        ///< about the tree's centre                       (bodies)
  SpatialInertia<Real>* composite;      ///< of a body and all that it carries             (bodies)
  Twist<Real>*velocity, *acceleration;  ///< about the tree's centre                       (bodies)
  Twist<Real>* force;                   ///< that a body needs                             (bodies)
  Vector3<Real>*anchor, *axis;          ///< of joints, in world axes                      (joints)
  Twist<Real>* motion;                  ///< that a degree of freedom makes                (dofs)
  Vector3<Real>* geom_position;         ///<                                               (geoms)
  Axes3<Real>* geom_axes;               ///<                                               (geoms)
  Real *bias, *passive, *actuator, *smooth, *qacc_smooth, *qacc, *start;  ///<                (dofs)
  Real *M, *factor, *inverse;        ///< M, its L'DL factor, and D's inverse     (entries, entries, dofs)
  Real *damped, *damped_inverse;     ///< of M with damping                       (entries, dofs)
  Real* braking;                     ///< of actuators, force per velocity, or null            (dofs)
  Real* distance;                    ///< of points                                     (points)
  Vector3<Real>*point, *normal;      ///<                                               (points)
  Mask<Real>* touches;               ///< lanes in which the point is a contact         (points)
  unsigned char* is_point;           ///< any lane                                      (points)
  Mask<Real>* limited;               ///< lanes in which the limit has a row            (limits)
  unsigned char* is_limit;           ///< any lane                                      (limits)
  Real* rank;                        ///< of a group among its robot's in its class, or -1     (groups)
  Real* reaction;                    ///< of rows, where bodies are observed                   (most_rows)
  Twist<Real>* contact_force;        ///< on bodies, about the tree's centre                   (bodies)
  Real* observed[kObservedArrays];   ///< as the batch has them                             (observed_width)
  Real* varied[kVariedArrays] = {};  ///< constants of the lanes, null: the model's           (varied_width)
  Real* subtree_mass = nullptr;      ///< where masses are those of the lanes                 (bodies)

  static STICTION_HD Numbers numbers(Real* array) { return {reinterpret_cast<T*>(array)}; }

  /// Lays the arrays that a job needs out in memory, or measures them. Returns bytes.
  STICTION_HD Offset place(const ArticulatedJob<T>& job, Index entries, char* memory) {
    const ArticulatedModelView<T>& model = job.model;
    ArrayTaker take{memory};
    const Index bodies = model.bodies, joints = model.joints, dofs = model.dof_count, points = model.points;
    for (Real** array : {&qpos, &first_qpos}) take(*array, model.q_count);
    take(ctrl, model.actuator_count);
    for (Real** array : {&qvel, &applied, &first_qvel, &rate, &sum_rate, &sum_qacc, &bias, &passive, &actuator, &smooth,
                         &qacc_smooth, &qacc, &start, &inverse, &damped_inverse})
      take(*array, dofs);
    for (Real** array : {&M, &factor, &damped}) take(*array, entries);
    braking = nullptr;
    if (model.acts_implicitly) take(braking, dofs);
    for (auto** array : {&position, &centre, &tree_centre}) take(*array, bodies);
    take(orientation, bodies);
    take(axes, bodies);
    for (auto** array : {&inertia, &composite}) take(*array, bodies);
    for (auto** array : {&velocity, &acceleration, &force}) take(*array, bodies);
    for (auto** array : {&anchor, &axis}) take(*array, joints);
    take(motion, dofs);
    take(geom_position, model.geoms);
    take(geom_axes, model.geoms);
    take(distance, points);
    for (auto** array : {&point, &normal}) take(*array, points);
    take(touches, points);
    take(is_point, points);
    take(limited, model.limits);
    take(is_limit, model.limits);
    take(rank, model.groups);
    for (std::size_t k = 0; k < kVariedArrays && job.varied != nullptr; ++k)
      if (job.varied[k] != nullptr) take(varied[k], model.varied_width[k]);
    if (job.varied != nullptr && job.varied[static_cast<std::size_t>(VariedArray::body_mass)] != nullptr)
      take(subtree_mass, bodies);
    if (job.observed == nullptr) return take.used;
    take(reaction, model.most_rows);
    take(contact_force, bodies);
    for (std::size_t k = 0; k < kObservedArrays; ++k) take(observed[k], model.observed_width[k]);
    return take.used;
  }
};

/// Arguments of the stages of a step.
template <class Real>
struct Robots {
  const ArticulatedModelView<Scalar<Real>>& model;
  const RobotTree& tree;
  RobotWorkspace<Real>& work;
};

}  // namespace stiction::inline STICTION_ISA
