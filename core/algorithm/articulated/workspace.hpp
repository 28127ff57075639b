#pragma once

#include "core/algorithm/articulated/lane_elements.hpp"
#include "core/algorithm/articulated/spatial.hpp"
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

/// Takes arrays from memory, one after another at multiples of lines of a cache, or measures them where there is none.
struct ArrayTaker {
  char* memory;
  Index lane = 0;  ///< of those whose numbers lie side by side
  Offset used = 0;

  template <class Element>
  STICTION_HD void operator()(Element*& array, Index count) {
    take(array, count * static_cast<Offset>(sizeof(Element)), 64);
  }
  template <class Element, class Number, int kApart>
  STICTION_HD void operator()(LaneElements<Element, Number, kApart>& array, Index count) {
    take(array.data, kApart * count * static_cast<Offset>(sizeof(Element)), kApart == 1 ? 64 : 128);
    array.data += lane;
  }

 private:
  template <class Number>
  STICTION_HD void take(Number*& array, Offset bytes, Offset line) {
    if (memory != nullptr) array = reinterpret_cast<Number*>(memory + used);
    used += (bytes + line - 1) / line * line;
  }
};

/// Arrays of the robots of a pack, or of a lane whose numbers lie kStride apart.
template <class Real, int kStride>
struct RobotWorkspace {
  using T = Scalar<Real>;
  static constexpr int kApart = kStride / RealTraits<Real>::kLanes;
  template <class Element, class Number = Real>
  using Array = LaneElements<Element, Number, kApart>;
  using Reals = Array<Real>;

  Reals qpos, qvel, ctrl, applied;            ///< state, and forces on it
  Reals first_qpos, first_qvel;               ///< where a step of several stages began
  Reals rate;                                 ///< of coordinates, as its stages add them up  (dofs)
  Reals sum_rate, sum_qacc;                   ///< of its stages                              (dofs)
  Array<Vector3<Real>> position;              ///< of bodies                                  (bodies)
  Array<Quaternion<Real>> orientation;        ///<                                            (bodies)
  Array<Axes3<Real>> axes;                    ///< the same as axes                           (bodies)
  Array<Vector3<Real>> centre;                ///< of mass                                    (bodies)
  Array<Vector3<Real>> tree_centre;           ///< of the whole tree, where its root is       (bodies)
  Array<SpatialInertia<Real>> inertia;        ///< about the tree's centre                    (bodies)
  Array<SpatialInertia<Real>> composite;      ///< of a body and all that it carries          (bodies)
  Array<Twist<Real>> velocity, acceleration;  ///< about the tree's centre                    (bodies)
  Array<Twist<Real>> force;                   ///< that a body needs                          (bodies)
  Array<Vector3<Real>> anchor, axis;          ///< of joints, in world axes                   (joints)
  Array<Twist<Real>> motion;                  ///< that a degree of freedom makes             (dofs)
  Array<Vector3<Real>> geom_position;         ///<                                            (geoms)
  Array<Axes3<Real>> geom_axes;               ///<                                            (geoms)
  Reals bias, passive, actuator, smooth;      ///<                                            (dofs)
  Reals qacc_smooth, qacc, start;             ///<                                            (dofs)
  Reals M, factor, inverse;                   ///< M, its L'DL factor, and D's inverse        (entries, entries, dofs)
  Reals damped, damped_inverse;               ///< of M with damping                          (entries, dofs)
  Reals braking;                              ///< of actuators, force per velocity, or null  (dofs)
  Reals distance;                             ///< of points                                  (points)
  Array<Vector3<Real>> point, normal;         ///<                                            (points)
  Array<Mask<Real>, Mask<Real>> touches;      ///< lanes in which the point is a contact      (points)
  Array<unsigned char, unsigned char> is_point;  ///< any lane                                   (points)
  Array<Mask<Real>, Mask<Real>> limited;         ///< lanes in which the limit has a row         (limits)
  Array<unsigned char, unsigned char> is_limit;  ///< any lane                                   (limits)
  Reals rank;                                    ///< of a group among its robot's in its class, or -1  (groups)
  Reals reaction;                                ///< of rows, where bodies are observed         (most_rows)
  Array<Twist<Real>> contact_force;              ///< on bodies, about the tree's centre         (bodies)
  Reals observed[kObservedArrays];               ///< as the batch has them                      (observed_width)
  Reals varied[kVariedArrays];                   ///< constants of the lanes, null: the model's  (varied_width)
  Reals subtree_mass;                            ///< where masses are those of the lanes        (bodies)

  /// Lays the arrays that a job needs out in memory, or measures them. Returns bytes, of all lanes side by side.
  STICTION_HD Offset place(const ArticulatedJob<T>& job, Index entries, char* memory, Index lane) {
    const ArticulatedModelView<T>& model = job.model;
    ArrayTaker take{memory, lane};
    const Index bodies = model.bodies, joints = model.joints, dofs = model.dof_count, points = model.points;
    for (Reals* array : {&qpos, &first_qpos}) take(*array, model.q_count);
    take(ctrl, model.actuator_count);
    for (Reals* array : {&qvel, &applied, &first_qvel, &rate, &sum_rate, &sum_qacc, &bias, &passive, &actuator, &smooth,
                         &qacc_smooth, &qacc, &start, &inverse, &damped_inverse})
      take(*array, dofs);
    for (Reals* array : {&M, &factor, &damped}) take(*array, entries);
    if (model.acts_implicitly) take(braking, dofs);
    for (auto* array : {&position, &centre, &tree_centre}) take(*array, bodies);
    take(orientation, bodies);
    take(axes, bodies);
    for (auto* array : {&inertia, &composite}) take(*array, bodies);
    for (auto* array : {&velocity, &acceleration, &force}) take(*array, bodies);
    for (auto* array : {&anchor, &axis}) take(*array, joints);
    take(motion, dofs);
    take(geom_position, model.geoms);
    take(geom_axes, model.geoms);
    take(distance, points);
    for (auto* array : {&point, &normal}) take(*array, points);
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
template <class Real, int kStride>
struct Robots {
  const ArticulatedModelView<Scalar<Real>>& model;
  const RobotTree& tree;
  RobotWorkspace<Real, kStride>& work;
};
template <class Types>
using RobotsOf = Robots<typename Types::Wide, Types::kStride>;
template <class Types>
using WorkspaceOf = RobotWorkspace<typename Types::Wide, Types::kStride>;

/// Numbers of a stage, one for each of something.
template <class Real, int kStride>
using RobotNumbers = typename RobotWorkspace<Real, kStride>::Reals;

}  // namespace stiction::inline STICTION_ISA
