#include <algorithm>
#include <cmath>
#include <string>

#include "core/base/extents.hpp"
#include "core/runtime/articulated/articulated_model.hpp"
#include "core/runtime/articulated/hull_faces.hpp"
#include "core/runtime/check/defects.hpp"
#include "core/runtime/check/expect.hpp"

namespace stiction {

namespace {

[[noreturn]] void refuse_model(const std::string& message) {
  throw Error(ErrorCode::unsupported, message);
}

std::string place_of(const char* list, std::size_t i, const char* field) {
  return std::string(list) + "[" + std::to_string(i) + "]." + field;
}

template <class Array>
void require_finite(const std::string& name, const Array& values) {
  if (!std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); }))
    refuse(name + " holds a number that is not finite: give numbers");
}
void require(bool holds, const std::string& name, double value, const char* rule) {
  if (!holds) refuse(name + " = " + shortest_text(value) + ": must be " + rule);
}
void require_unit(const std::string& name, const std::array<double, 4>& q) {
  const double square = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
  if (!(std::fabs(square - 1) <= 1e-6)) refuse(name + " has no unit length: give a unit quaternion (w, x, y, z)");
}
void require_place(const std::string& name, Index value, std::size_t count) {
  if (value < 0 || at(value) >= count)
    refuse(name + " = " + std::to_string(value) + ": must be at least 0 and less than " + std::to_string(count));
}

void check_give(const std::string& name, const ArticulatedGive& give) {
  require_finite(name + ".solref", give.solref);
  require_finite(name + ".solimp", give.solimp);
  const double power = give.solimp[4];
  if (power != std::floor(power) || power < 1 || power > 8)
    refuse_model(name + ".solimp[4] = " + shortest_text(power) +
                 ": integers from 1 to 8 are stepped in lanes; round it to one");
  if ((give.solref[0] > 0) != (give.solref[1] > 0) && give.solref[1] != 0)
    refuse(name + ".solref has numbers of different signs: give both as times, or both as rates");
}

/// Counts the joints, and velocities, of a description.
void check_bodies(const ArticulatedDescription& model) {
  if (model.bodies.empty()) refuse("bodies is empty: body 0 is the world");
  if (model.bodies[0].joints != 0) refuse("bodies[0].joints: must be 0, the world does not move");
  std::size_t joint = 0, dof = 0;
  for (std::size_t b = 0; b < model.bodies.size(); ++b) {
    const ArticulatedBody& body = model.bodies[b];
    if (b > 0) require_place(place_of("bodies", b, "parent"), body.parent, b);
    require_finite(place_of("bodies", b, "position"), body.position);
    require_finite(place_of("bodies", b, "centre"), body.centre);
    require_finite(place_of("bodies", b, "inertia"), body.inertia);
    require_finite(place_of("bodies", b, "inverse_weight"), body.inverse_weight);
    require_unit(place_of("bodies", b, "orientation"), body.orientation);
    require_unit(place_of("bodies", b, "inertia_axes"), body.inertia_axes);
    require(body.mass >= 0 && std::isfinite(body.mass), place_of("bodies", b, "mass"), body.mass, ">= 0 and finite");
    require(std::isfinite(body.gravity_compensation), place_of("bodies", b, "gravity_compensation"),
            body.gravity_compensation, "finite");
    if (body.joints < 0 || joint + at(body.joints) > model.joints.size())
      refuse(place_of("bodies", b, "joints") + " = " + std::to_string(body.joints) + ": there are " +
             std::to_string(model.joints.size()) + " joints for all bodies");
    for (const std::size_t end = joint + at(body.joints); joint < end; ++joint) {
      const ArticulatedJoint& one = model.joints[joint];
      const bool is_free = one.kind == JointKind::free, is_spin = is_free || one.kind == JointKind::ball;
      dof += is_free ? 6 : is_spin ? 3 : 1;
      if (is_free && (body.parent != 0 || body.joints != 1))
        refuse(place_of("joints", joint, "kind") + " is free: must be its body's only one, and the body on the world");
      if (is_spin && one.is_limited)
        refuse_model(place_of("joints", joint, "is_limited") +
                     ": limits of free and ball joints are not stepped in lanes");
      if (is_spin && one.stiffness != 0)
        refuse_model(place_of("joints", joint, "stiffness") +
                     ": springs of free and ball joints are not stepped in lanes");
      require_finite(place_of("joints", joint, "position"), one.position);
      require_finite(place_of("joints", joint, "axis"), one.axis);
      require_finite(place_of("joints", joint, "range"), one.range);
      require_finite(place_of("joints", joint, "numbers"),
                     std::array<double, 4>{one.reference, one.stiffness, one.rest, one.margin});
      check_give(place_of("joints", joint, "limit"), one.limit);
    }
  }
  expect_length("joints", model.joints.size(), joint, "as many as all bodies have");
  expect_length("dofs", model.dofs.size(), dof, "six of a free joint, three of a ball, one of others");
  if (dof > at(kMostArticulatedDofs))
    refuse_model("dofs has " + std::to_string(dof) + " degrees of freedom: up to " +
                 std::to_string(kMostArticulatedDofs) + " are stepped in lanes");
}

void check_dofs(const ArticulatedDescription& model) {
  for (std::size_t i = 0; i < model.dofs.size(); ++i) {
    const ArticulatedDof& dof = model.dofs[i];
    require_finite(place_of("dofs", i, "numbers"),
                   std::array<double, 4>{dof.armature, dof.damping, dof.friction_loss, dof.inverse_weight});
    require(dof.friction_loss >= 0, place_of("dofs", i, "friction_loss"), dof.friction_loss, ">= 0");
    check_give(place_of("dofs", i, "loss"), dof.loss);
  }
}

/// Returns true for a joint of more than one velocity.
bool is_spin(const ArticulatedDescription& model, Index joint) {
  return model.joints[at(joint)].kind < JointKind::slide;
}

void check_actuators(const ArticulatedDescription& model) {
  for (std::size_t i = 0; i < model.actuators.size(); ++i) {
    const ArticulatedActuator& one = model.actuators[i];
    require_place(place_of("actuators", i, "joint"), one.joint, model.joints.size());
    if (is_spin(model, one.joint))
      refuse_model(place_of("actuators", i, "joint") + ": actuators of hinges and slides alone are stepped in lanes");
    require_finite(place_of("actuators", i, "gain"), one.gain);
    require_finite(place_of("actuators", i, "bias"), one.bias);
    require(std::isfinite(one.gear), place_of("actuators", i, "gear"), one.gear, "finite");
  }
}

void check_tendons(const ArticulatedDescription& model) {
  if (model.tendons < 0) refuse("tendons = " + std::to_string(model.tendons) + ": must be >= 0");
  for (std::size_t i = 0; i < model.tendon_terms.size(); ++i) {
    const ArticulatedTendonTerm& one = model.tendon_terms[i];
    require_place(place_of("tendon_terms", i, "tendon"), one.tendon, at(model.tendons));
    require_place(place_of("tendon_terms", i, "joint"), one.joint, model.joints.size());
    if (is_spin(model, one.joint)) refuse(place_of("tendon_terms", i, "joint") + ": must be a hinge or a slide");
    require(std::isfinite(one.coefficient), place_of("tendon_terms", i, "coefficient"), one.coefficient, "finite");
  }
}

void check_equalities(const ArticulatedDescription& model) {
  for (std::size_t i = 0; i < model.equalities.size(); ++i) {
    const ArticulatedEquality& one = model.equalities[i];
    require_place(place_of("equalities", i, "joint_a"), one.joint_a, model.joints.size());
    if (one.joint_b != -1) require_place(place_of("equalities", i, "joint_b"), one.joint_b, model.joints.size());
    if (one.joint_b == one.joint_a) refuse(place_of("equalities", i, "joint_b") + " is joint_a: give another, or -1");
    if (is_spin(model, one.joint_a) || (one.joint_b >= 0 && is_spin(model, one.joint_b)))
      refuse_model("equalities[" + std::to_string(i) + "]: those of hinges and slides alone are stepped in lanes");
    require_finite(place_of("equalities", i, "polynomial"), one.polynomial);
    check_give(place_of("equalities", i, "give"), one.give);
  }
}

/// Returns true if no joint moves a body.
bool never_moves(const ArticulatedDescription& model, Index body) {
  for (; body > 0; body = model.bodies[at(body)].parent)
    if (model.bodies[at(body)].joints > 0) return false;
  return true;
}

void check_fields(const ArticulatedDescription& model) {
  for (std::size_t i = 0; i < model.fields.size(); ++i) {
    const ArticulatedHeightField& field = model.fields[i];
    require(field.rows >= 2, place_of("fields", i, "rows"), field.rows, "at least 2");
    require(field.columns >= 2, place_of("fields", i, "columns"), field.columns, "at least 2");
    for (const double half : field.half)
      require(half > 0 && std::isfinite(half), place_of("fields", i, "half"), half, "> 0 and finite");
    require(field.base > 0 && std::isfinite(field.base), place_of("fields", i, "base"), field.base, "> 0 and finite");
    expect_length(place_of("fields", i, "heights").c_str(), field.heights.size(), at(field.rows) * at(field.columns),
                  "rows times columns");
    for (const double height : field.heights)
      require(height > -field.base && std::isfinite(height), place_of("fields", i, "heights"), height,
              "finite and above -base");
  }
}

void check_hulls(const ArticulatedDescription& model) {
  for (std::size_t i = 0; i < model.hulls.size(); ++i) {
    const ArticulatedHull& hull = model.hulls[i];
    require(!hull.vertices.empty(), place_of("hulls", i, "vertices.size()"), 0, "at least 1");
    for (const auto& vertex : hull.vertices) require_finite(place_of("hulls", i, "vertices"), vertex);
    require(!hull.face_begin.empty() && hull.face_begin[0] == 0, place_of("hulls", i, "face_begin"),
            hull.face_begin.empty() ? 0 : hull.face_begin[0], "0 at first");
    for (std::size_t face = 0; face + 1 < hull.face_begin.size(); ++face)
      require(hull.face_begin[face + 1] >= hull.face_begin[face] + 3, place_of("hulls", i, "face_begin"),
              hull.face_begin[face + 1], "three or more corners after the last");
    expect_length(place_of("hulls", i, "corners").c_str(), hull.corners.size(), at(hull.face_begin.back()),
                  "face_begin's last");
    for (const Index corner : hull.corners)
      require_place(place_of("hulls", i, "corners"), corner, hull.vertices.size());
    for (std::size_t face = 0; face + 1 < hull.face_begin.size(); ++face)
      require(length_of(area_of(hull, face)) > 0, place_of("hulls", i, "face_begin"), hull.face_begin[face],
              "the first corner of a face with an area");
  }
}

void check_geoms(const ArticulatedDescription& model) {
  for (std::size_t i = 0; i < model.geoms.size(); ++i) {
    const ArticulatedGeom& geom = model.geoms[i];
    require_place(place_of("geoms", i, "body"), geom.body, model.bodies.size());
    const bool is_known = geom.kind == GeomKind::plane || geom.kind == GeomKind::height_field ||
                          geom.kind == GeomKind::sphere || geom.kind == GeomKind::capsule ||
                          geom.kind == GeomKind::cylinder || geom.kind == GeomKind::box || geom.kind == GeomKind::mesh;
    if (!is_known)
      refuse(place_of("geoms", i, "kind") + " = " + std::to_string(static_cast<int>(geom.kind)) +
             ": must be that of a plane, height field, sphere, capsule, cylinder, box or mesh");
    require_finite(place_of("geoms", i, "position"), geom.position);
    require_finite(place_of("geoms", i, "size"), geom.size);
    require_unit(place_of("geoms", i, "orientation"), geom.orientation);
    if (geom.kind == GeomKind::height_field)
      require_place(place_of("geoms", i, "field"), geom.field, model.fields.size());
    if (geom.kind == GeomKind::mesh) require_place(place_of("geoms", i, "hull"), geom.hull, model.hulls.size());
  }
}

void check_pairs(const ArticulatedDescription& model) {
  for (std::size_t i = 0; i < model.pairs.size(); ++i) {
    const ArticulatedPair& pair = model.pairs[i];
    require_place(place_of("pairs", i, "geom_a"), pair.geom_a, model.geoms.size());
    require_place(place_of("pairs", i, "geom_b"), pair.geom_b, model.geoms.size());
    const ArticulatedGeom &a = model.geoms[at(pair.geom_a)], &b = model.geoms[at(pair.geom_b)];
    const bool is_on_field = b.kind == GeomKind::sphere || b.kind == GeomKind::capsule || b.kind == GeomKind::box;
    const bool has_field = a.kind == GeomKind::height_field || b.kind == GeomKind::height_field;
    if (has_field && !(a.kind == GeomKind::height_field && is_on_field && never_moves(model, a.body)))
      refuse_model(
          "pairs[" + std::to_string(i) +
          "]: height fields touch spheres, capsules and boxes in lanes, and stand still: give the field first");
    const bool is_ground = a.kind == GeomKind::plane && b.kind != GeomKind::plane && never_moves(model, a.body);
    if (!is_ground && (a.kind == GeomKind::plane || b.kind == GeomKind::plane))
      refuse_model("pairs[" + std::to_string(i) +
                   "]: planes touch everything but planes in lanes, and stand still: give the plane first");
    for (const ArticulatedGeom& geom : {a, b}) {
      if (is_ground || geom.kind != GeomKind::mesh) continue;
      const ArticulatedHull& hull = model.hulls[at(geom.hull)];
      const std::string place = "pairs[" + std::to_string(i) + "]: ",
                        which = "hulls[" + std::to_string(geom.hull) + "]";
      if (most_corners(hull) > kMostFaceCorners)
        refuse_model(place + "a face of " + which + " has " + std::to_string(most_corners(hull)) + " corners: up to " +
                     std::to_string(kMostFaceCorners) + " touch others than planes in lanes; give fewer");
      if (!has_faces_everywhere(hull)) refuse(place + which + " has a vertex that is no face's corner: give all faces");
    }
    if (a.kind > b.kind) refuse("pairs[" + std::to_string(i) + "]: kinds of geoms must ascend: swap geom_a and geom_b");
    if (pair.dim != 1 && pair.dim != 3 && pair.dim != 4 && pair.dim != 6)
      refuse(place_of("pairs", i, "dim") + " = " + std::to_string(pair.dim) + ": must be 1, 3, 4 or 6");
    for (const double mu : pair.friction)
      require(mu > 0 && std::isfinite(mu), place_of("pairs", i, "friction"), mu, "> 0 and finite");
    require_finite(place_of("pairs", i, "margin"), std::array<double, 2>{pair.margin, pair.reach});
    check_give(place_of("pairs", i, "give"), pair.give);
  }
}

}  // namespace

void check_articulated(const ArticulatedDescription& description) {
  require(description.timestep > 0 && std::isfinite(description.timestep), "timestep", description.timestep, "> 0");
  require(description.impratio > 0 && std::isfinite(description.impratio), "impratio", description.impratio, "> 0");
  require_finite("gravity", description.gravity);
  check_bodies(description);
  check_dofs(description);
  check_actuators(description);
  check_equalities(description);
  check_tendons(description);
  check_fields(description);
  check_hulls(description);
  check_geoms(description);
  check_pairs(description);
}

}  // namespace stiction
