#pragma once

#include "stiction/articulated.hpp"

/// A model of joints and bodies as plain data: what crosses into code compiled for an instruction set. Every order
/// that a sum could follow is decided here, in integers.
namespace stiction {

/// Most degrees of freedom: a set of them is one word.
inline constexpr Index kMostArticulatedDofs = 64;
/// Most rows of an environment that could be active at one time.
inline constexpr Index kMostArticulatedRows = 8192;

/// Most points of a capsule or a box on a height field.
inline constexpr Index kMostFieldPoints = 16;
/// Most corners of a hull's face that meets others than planes.
inline constexpr Index kMostFaceCorners = 32;

/// Share of the sum of a body's principal moments by which two differ that count as equal.
inline constexpr double kSameMoments = 1e-13;

template <class T>
struct ArticulatedBodyData {
  Index parent, root;
  Index joint_begin, joint_end, dof_begin, dof_end;
  T position[3], orientation[4], centre[3];
  T mass, subtree_mass;
  T held_share;    ///< of the mass, whose weight a passive force holds
  bool is_turned;  ///< its orientation is not the identity
  /// Inertia: `round` about all axes, and more about some. Principal moments that these come from: round's, then
  /// others.
  T round;
  Index more_axes;
  T more[2], axis[2][3];
  Index moment[3];
};

template <class T>
struct ArticulatedJointData {
  JointKind kind;
  Index body, q, dof;
  bool is_offset, is_force_limited;
  bool is_lone;  ///< free, of a body that carries no joint
  T position[3], axis[3];
  T reference, stiffness, rest;
  T force_range[2];
};

/// Direction in which a degree of freedom moves.
enum class DofKind : std::uint8_t { x = 0, y = 1, z = 2, hinge = 3, slide = 4, spin = 5 };

template <class T>
struct ArticulatedDofData {
  Index body, joint, parent;  ///< parent: degree of freedom before it on the way to the root, or -1
  DofKind kind;
  T armature, damping, step_damping;  ///< the last: times the step
};

template <class T>
struct ArticulatedActuatorData {
  Index q, dof;
  T gear, gain[3], bias[3], control[2], force[2];
};

template <class T>
struct ArticulatedGeomData {
  Index body;
  GeomKind kind;
  T size[3], position[3], axes[9];  ///< columns: the geom's axes in its body's
  Index field;                      ///< of a height field
  Index hull_begin, hull_end;       ///< vertices of a mesh among those of all hulls
};

/// A vertex of a hull, in the geom's frame.
template <class T>
struct ArticulatedVertexData {
  T place[3];
  Index face_begin, face_end;  ///< its faces among those of all vertices
};

/// A face of a hull for one of its vertices: that and up to three others stand for the face.
template <class T>
struct ArticulatedFaceData {
  T normal[3];  ///< outward, in the geom's frame
  Index others, other[3];
  Index begin, end;  ///< its corners among those of all hulls; the same for each of its vertices
  Index place;       ///< of the vertex among these
};

/// Returns false for shapes that are round about their z axis, and for planes.
constexpr bool has_three_axes(GeomKind kind) {
  return kind == GeomKind::height_field || kind >= GeomKind::cylinder;
}

/// Returns true for shapes whose contacts with others than planes are found by their support.
constexpr bool is_general(GeomKind kind) {
  return kind == GeomKind::cylinder || kind == GeomKind::mesh;
}

template <class T>
struct ArticulatedFieldData {
  Index rows, columns;
  Offset first;        ///< of its heights among those of all fields
  T half[2], cell[2];  ///< widths along x and y
  T base;
};

/// How a row's compliance and reference follow from its distance.
template <class T>
struct RowGive {
  T low, rise;      ///< impedance at no distance, and what it rises by
  T inverse_width;  ///< of distances over which it rises
  T middle;         ///< share of that in which it curves up
  T up, down;       ///< factors of either part
  Index power;
  T stiffness, damping, tangential_damping;
  T weight;  ///< inverse inertia that compliance is measured by; without friction's part where that varies
};

template <class T>
struct ArticulatedPairData {
  Index geom_a, geom_b;
  Index dim;
  Index first;          ///< of its points among all
  Index points;         ///< that it may have
  T normal[3], offset;  ///< of the plane, if the first geom is one
  T margin;             ///< distance below which a point has rows
  T reach;              ///< distance up to which a point counts: of a box the first four do
  T bound;              ///< of centres, beyond which nothing touches; of one above a plane or a field's frame
  T friction[5];
  T ratio[6];  ///< compliance of each row over the normal's; of a pyramid ratio[1] is its edges'
  RowGive<T> give;
};

template <class T>
struct ArticulatedLimitData {
  Index q, dof;
  T sign, bound, margin;
  RowGive<T> give;
};

template <class T>
struct ArticulatedLossData {
  Index dof;
  T most;
  RowGive<T> give;
};

template <class T>
struct ArticulatedEqualityData {
  Index q_a, dof_a;
  Index q_b, dof_b;  ///< -1: it follows no joint
  T reference_a, reference_b, polynomial[5];
  RowGive<T> give;
};

template <class T>
struct ArticulatedTendonTermData {
  Index tendon, q, dof;
  T coefficient;
};

/// A set of arrays that VariedArray names: a bit for each.
using VariedSet = unsigned;
constexpr VariedSet bit_of(VariedArray array) {
  return 1U << static_cast<unsigned>(array);
}

/// Rows that come and go together.
struct RowGroup {
  Index index;  ///< of the equality, of the loss, of the limit, or of the contact's point
  Index pair;   ///< of a contact
};

/// Groups of rows that differ in numbers alone. A robot's first one lies beside another's first one, whichever these
/// are, so that few lanes are without.
enum class RowSource : std::uint8_t { equality, loss, limit, contact };
struct RowClass {
  RowSource source;
  Index begin, end;    ///< of its groups
  Index dim;           ///< directions of a contact
  Index cones;         ///< in which a group's rows are
  Index rows;          ///< of each cone
  std::uint64_t dofs;  ///< that all of them touch
  Index columns;       ///< first of its degrees of freedom among those of all classes
  Index column_count;
};

/// Integers in the order of the solve: classes of one row first, by degrees of freedom, then groups by number.
template <class T>
struct ArticulatedModelView {
  Index q_count, dof_count, actuator_count;
  Index bodies, joints, geoms, fields, heights, vertices, faces, corners, pairs, points, equalities, limits, losses,
      groups;
  Index classes;
  Index most_rows;
  T step;
  T gravity[3];
  T impratio;
  bool is_elliptic, is_rk4;
  bool damps_implicitly;  ///< damping is that of the new velocities
  bool acts_implicitly;   ///< forces of actuators are
  bool spins_implicitly;  ///< gyroscopic moments of lone bodies are
  bool holds_weight;      ///< some body has a held mass
  bool is_one_tree;       ///< all bodies that move hang together
  const ArticulatedBodyData<T>* body;
  const ArticulatedJointData<T>* joint;
  const ArticulatedDofData<T>* dof;
  const ArticulatedActuatorData<T>* actuator;
  const ArticulatedGeomData<T>* geom;
  const ArticulatedFieldData<T>* field;
  const T* height;  ///< of all fields, row by row
  const ArticulatedVertexData<T>* vertex;
  const ArticulatedFaceData<T>* face;
  const Index* corner;  ///< vertices of faces, that turn left about the normal
  const ArticulatedPairData<T>* pair;
  const ArticulatedEqualityData<T>* equality;
  const ArticulatedLimitData<T>* limit;
  const ArticulatedLossData<T>* loss;
  Index tendon_terms;
  const ArticulatedTendonTermData<T>* tendon_term;
  Index observed_width[kObservedArrays];  ///< numbers of an environment in each
  Index varied_width[kVariedArrays];      ///< likewise
  const RowGroup* group;
  const RowClass* row_class;
  const Index* column;
  const std::int8_t* column_side;  ///< 1: the second body moves, -1: the first
};

/// How many columns all classes of rows have.
template <class T>
STICTION_HD Index column_count(const ArticulatedModelView<T>& model) {
  if (model.classes == 0) return 0;
  const RowClass& last = model.row_class[model.classes - 1];
  return last.columns + last.column_count;
}

/// f(elements, array of each view) of all arrays of a model.
template <class T, class F, class... Views>
void for_each_model_array(const ArticulatedModelView<T>& model, F&& f, Views&... views) {
  f(model.bodies, views.body...);
  f(model.joints, views.joint...);
  f(model.dof_count, views.dof...);
  f(model.actuator_count, views.actuator...);
  f(model.geoms, views.geom...);
  f(model.fields, views.field...);
  f(model.heights, views.height...);
  f(model.vertices, views.vertex...);
  f(model.faces, views.face...);
  f(model.corners, views.corner...);
  f(model.pairs, views.pair...);
  f(model.equalities, views.equality...);
  f(model.limits, views.limit...);
  f(model.losses, views.loss...);
  f(model.tendon_terms, views.tendon_term...);
  f(model.groups, views.group...);
  f(model.classes, views.row_class...);
  f(column_count(model), views.column...);
  f(column_count(model), views.column_side...);
}

/// Numbers for tests, in the batch's layout; null: none.
struct ArticulatedProbeView {
  double *M, *bias, *passive, *actuator, *qacc_smooth, *qacc, *J, *aref, *R, *contact;
  std::int32_t *rows, *contacts, *pair;
  Index most_rows, most_contacts;
};

/// f(elements, array of each probe) of all arrays that so many environments fill.
template <class T, class F, class... Probes>
void for_each_probe_array(const ArticulatedModelView<T>& model, Offset envs, F&& f, Probes&... probes) {
  const Offset dofs = envs * model.dof_count, rows = envs * model.most_rows, points = envs * model.points;
  f(dofs * model.dof_count, probes.M...);
  f(dofs, probes.bias...);
  f(dofs, probes.passive...);
  f(dofs, probes.actuator...);
  f(dofs, probes.qacc_smooth...);
  f(dofs, probes.qacc...);
  f(envs, probes.rows...);
  f(envs, probes.contacts...);
  f(rows * model.dof_count, probes.J...);
  f(rows, probes.aref...);
  f(rows, probes.R...);
  f(7 * points, probes.contact...);
  f(points, probes.pair...);
}

/// Environments of a model, in rows of their own.
template <class T>
struct ArticulatedJob {
  ArticulatedModelView<T> model;
  T *qpos, *qvel, *qacc;
  double* time;
  const T *ctrl, *qfrc_applied;
  const std::uint8_t* active;  ///< null: all
  EnvStatus* status;
  std::uint64_t* touched;  ///< bit k: the last step had rows of a class k, k + 64, ...
  double tolerance;
  Index max_iterations;
  const ArticulatedProbeView* probe;  ///< null: none
  T* const* observed;                 ///< arrays in the order of ObservedArray; null: none is kept
  const T* const* varied;             ///< in the order of VariedArray; null, or null there: the model's
  bool is_still;                      ///< accelerations are computed, and no step is made
  double timestep;                    ///< that time goes on by
};

/// f(numbers of an environment, array of each job) of the arrays that steps read, and of those that they write, too.
template <class T, class F, class... Jobs>
void for_each_input_array(const ArticulatedModelView<T>& model, F&& f, Jobs&... jobs) {
  f(model.actuator_count, jobs.ctrl...);
  f(model.dof_count, jobs.qfrc_applied...);
}
template <class T, class F, class... Jobs>
void for_each_state_array(const ArticulatedModelView<T>& model, F&& f, Jobs&... jobs) {
  f(model.q_count, jobs.qpos...);
  f(model.dof_count, jobs.qvel...);
  f(model.dof_count, jobs.qacc...);
  f(Index{1}, jobs.time...);
  f(Index{1}, jobs.status...);
}

}  // namespace stiction
