#include "stiction/articulated.hpp"

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <mutex>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "python/src/array.hpp"
#include "python/src/signal_check.hpp"

namespace nb = nanobind;

namespace stiction::python {

namespace {

using Two = std::array<double, 2>;
using Three = std::array<double, 3>;
using Four = std::array<double, 4>;
using Five = std::array<double, 5>;

/// Constants that may vary, by the names that MuJoCo has for them but where an array has another layout.
constexpr std::pair<const char*, VariedArray> kVariedNames[] = {
    {"body_mass", VariedArray::body_mass},         {"body_inertia", VariedArray::body_inertia},
    {"pair_friction", VariedArray::pair_friction}, {"actuator_gain", VariedArray::actuator_gain},
    {"actuator_bias", VariedArray::actuator_bias}, {"dof_damping", VariedArray::dof_damping},
    {"dof_armature", VariedArray::dof_armature},   {"dof_frictionloss", VariedArray::dof_friction_loss}};

/// Values of those of the names that are there.
std::vector<VariedArray> varied_of(const std::vector<std::string>& names) {
  std::vector<VariedArray> found;
  for (const auto& [name, which] : kVariedNames)
    for (const std::string& one : names)
      if (one == name) found.push_back(which);
  return found;
}

/// Robots in either precision, whose calls wait for one another.
class SharedRobots {
 public:
  SharedRobots(const ArticulatedDescription& description, Offset env_count, double tolerance, Index max_iterations,
               int threads, bool observes, const std::vector<std::string>& varies, bool wide, const std::string& device)
      : robots_(made(Device::from_string(device), description, env_count,
                     {tolerance, max_iterations, threads, observes, varied_of(varies)}, wide)) {}

  void step(std::int64_t count, const Array* active) {
    const std::span<const std::uint8_t> mask = mask_of(active);
    const nb::gil_scoped_release unlocked;
    const std::lock_guard lock(mutex_);
    std::visit(
        [&](auto& robots) {
          SignalCheck signals;
          // Robots of a pack make all steps of a call at once, so a long call is made of shorter ones.
          constexpr std::int64_t kMost = 16;
          for (std::int64_t done = 0; done < count; done += kMost) {
            robots.step(static_cast<Index>(count - done < kMost ? count - done : kMost), mask);
            signals.look();
          }
        },
        robots_);
  }

  void forward(const Array* active) {
    const std::span<const std::uint8_t> mask = mask_of(active);
    const nb::gil_scoped_release unlocked;
    const std::lock_guard lock(mutex_);
    std::visit([&](auto& robots) { robots.forward(mask); }, robots_);
  }

  /// An array of the batch as a NumPy array over its memory, which may be written.
  nb::object array(nb::handle self, const char* name) {
    return std::visit(
        [&]<class Real>(ArticulatedBatch<Real>& robots) {
          const std::string_view of = name;
          const std::span<Real> values = of == "qpos"   ? robots.qpos()
                                         : of == "qvel" ? robots.qvel()
                                         : of == "ctrl" ? robots.ctrl()
                                         : of == "qacc" ? robots.qacc()
                                                        : robots.qfrc_applied();
          const auto envs = static_cast<std::size_t>(robots.env_count());
          const auto width = static_cast<std::size_t>(of == "qpos"   ? robots.q_count()
                                                      : of == "ctrl" ? robots.actuator_count()
                                                                     : robots.dof_count());
          return nb::cast(nb::ndarray<nb::numpy, Real, nb::ndim<2>>(values.data(), {envs, width}, self));
        },
        robots_);
  }

  /// An observed array (envs, width), over the batch's memory, which may be written.
  nb::object observed(nb::handle self, ObservedArray which) {
    return std::visit(
        [&](auto& robots) { return view_of(self, robots, robots.observed(which), robots.observed_width(which)); },
        robots_);
  }
  /// Constants of environments, likewise.
  nb::object varied(nb::handle self, VariedArray which) {
    return std::visit(
        [&](auto& robots) { return view_of(self, robots, robots.varied(which), robots.varied_width(which)); }, robots_);
  }

  /// Records of the last step as bytes (envs, 32), over the batch's memory.
  nb::object status(nb::handle self) {
    return std::visit(
        [&](auto& robots) {
          const auto records = robots.status();
          const auto* const bytes = reinterpret_cast<const std::uint8_t*>(records.data());
          using Bytes = nb::ndarray<nb::numpy, const std::uint8_t, nb::ndim<2>>;
          return nb::cast(Bytes(bytes, {records.size(), sizeof(EnvStatus)}, self));
        },
        robots_);
  }

  std::uint64_t hash() {
    return std::visit([](auto& robots) { return robots.hash(); }, robots_);
  }

  nb::dict probe() {
    ArticulatedProbe found;
    {
      const nb::gil_scoped_release unlocked;
      const std::lock_guard lock(mutex_);
      found = std::visit([](auto& robots) { return robots.probe(); }, robots_);
    }
    nb::dict to;
    const auto copy = [&](const char* name, const auto& values) {
      using Number = typename std::decay_t<decltype(values)>::value_type;
      auto* const kept = new std::vector<Number>(values);
      const nb::capsule owner(kept, [](void* memory) noexcept { delete static_cast<std::vector<Number>*>(memory); });
      to[name] = nb::cast(nb::ndarray<nb::numpy, Number, nb::ndim<1>>(kept->data(), {kept->size()}, owner));
    };
    copy("M", found.M);
    copy("bias", found.bias);
    copy("passive", found.passive);
    copy("actuator", found.actuator);
    copy("qacc_smooth", found.qacc_smooth);
    copy("qacc", found.qacc);
    copy("rows", found.rows);
    copy("contacts", found.contacts);
    copy("J", found.J);
    copy("aref", found.aref);
    copy("R", found.R);
    copy("contact", found.contact);
    copy("pair", found.pair);
    to["most_rows"] = found.most_rows;
    to["most_contacts"] = found.most_contacts;
    return to;
  }

 private:
  template <class Real>
  static nb::object view_of(nb::handle self, const ArticulatedBatch<Real>& robots, std::span<Real> values,
                            Index width) {
    using Numbers = nb::ndarray<nb::numpy, Real, nb::ndim<2>>;
    return nb::cast(
        Numbers(values.data(), {static_cast<std::size_t>(robots.env_count()), static_cast<std::size_t>(width)}, self));
  }
  static std::span<const std::uint8_t> mask_of(const Array* active) {
    if (active == nullptr) return {};
    return {active->read<std::uint8_t>("active"), static_cast<std::size_t>(active->size())};
  }
  using Either = std::variant<ArticulatedBatch<float>, ArticulatedBatch<double>>;
  static Either made(Device device, const ArticulatedDescription& description, Offset env_count,
                     const ArticulatedOptions& options, bool wide) {
    if (wide) return ArticulatedBatch<double>(device, description, env_count, options);
    return ArticulatedBatch<float>(device, description, env_count, options);
  }

  std::mutex mutex_;
  Either robots_;
};

void bind_description(nb::module_& module) {
  using D = ArticulatedDescription;
  nb::class_<D>(module, "ArticulatedDescription")
      .def(nb::init<>())
      .def_rw("timestep", &D::timestep)
      .def_rw("gravity", &D::gravity)
      .def_rw("is_elliptic", &D::is_elliptic)
      .def_rw("impratio", &D::impratio)
      .def_rw("is_rk4", &D::is_rk4)
      .def_rw("damps_implicitly", &D::damps_implicitly)
      .def_rw("is_implicit_fast", &D::is_implicit_fast)
      .def_rw("keeps_references", &D::keeps_references)
      .def(
          "add_body",
          [](D& to, Index parent, Index joints, Three position, Four orientation, double mass, Three centre,
             Four inertia_axes, Three inertia, Two inverse_weight, double gravity_compensation) {
            to.bodies.push_back({parent, joints, position, orientation, mass, centre, inertia_axes, inertia,
                                 inverse_weight, gravity_compensation});
          },
          nb::kw_only(), nb::arg("parent"), nb::arg("joints"), nb::arg("position"), nb::arg("orientation"),
          nb::arg("mass"), nb::arg("centre"), nb::arg("inertia_axes"), nb::arg("inertia"), nb::arg("inverse_weight"),
          nb::arg("gravity_compensation"))
      .def(
          "add_joint",
          [](D& to, int kind, Three position, Three axis, double reference, double stiffness, double rest,
             bool is_limited, Two range, double margin, Two solref, Five solimp, bool is_force_limited,
             Two force_range) {
            to.joints.push_back({static_cast<JointKind>(kind),
                                 position,
                                 axis,
                                 reference,
                                 stiffness,
                                 rest,
                                 is_limited,
                                 range,
                                 margin,
                                 {solref, solimp},
                                 is_force_limited,
                                 force_range});
          },
          nb::kw_only(), nb::arg("kind"), nb::arg("position"), nb::arg("axis"), nb::arg("reference"),
          nb::arg("stiffness"), nb::arg("rest"), nb::arg("is_limited"), nb::arg("range"), nb::arg("margin"),
          nb::arg("solref"), nb::arg("solimp"), nb::arg("is_force_limited"), nb::arg("force_range"))
      .def(
          "add_dof",
          [](D& to, double armature, double damping, double friction_loss, Two solref, Five solimp,
             double inverse_weight) {
            to.dofs.push_back({armature, damping, friction_loss, {solref, solimp}, inverse_weight});
          },
          nb::kw_only(), nb::arg("armature"), nb::arg("damping"), nb::arg("friction_loss"), nb::arg("solref"),
          nb::arg("solimp"), nb::arg("inverse_weight"))
      .def(
          "add_actuator",
          [](D& to, Index joint, double gear, Three gain, Three bias, Two control, Two force) {
            to.actuators.push_back({joint, gear, gain, bias, control, force});
          },
          nb::kw_only(), nb::arg("joint"), nb::arg("gear"), nb::arg("gain"), nb::arg("bias"), nb::arg("control"),
          nb::arg("force"))
      .def(
          "add_equality",
          [](D& to, Index joint_a, Index joint_b, Five polynomial, Two solref, Five solimp) {
            to.equalities.push_back({joint_a, joint_b, polynomial, {solref, solimp}});
          },
          nb::kw_only(), nb::arg("joint_a"), nb::arg("joint_b"), nb::arg("polynomial"), nb::arg("solref"),
          nb::arg("solimp"))
      .def(
          "add_geom",
          [](D& to, Index body, int kind, Three size, Three position, Four orientation, Index field) {
            to.geoms.push_back({body, static_cast<GeomKind>(kind), size, position, orientation, field});
          },
          nb::kw_only(), nb::arg("body"), nb::arg("kind"), nb::arg("size"), nb::arg("position"), nb::arg("orientation"),
          nb::arg("field"))
      .def(
          "add_field",
          [](D& to, Index rows, Index columns, Two half, double base, std::vector<double> heights) {
            to.fields.push_back({rows, columns, half, base, std::move(heights)});
          },
          nb::kw_only(), nb::arg("rows"), nb::arg("columns"), nb::arg("half"), nb::arg("base"), nb::arg("heights"))
      .def(
          "add_pair",
          [](D& to, Index geom_a, Index geom_b, Index dim, Five friction, double margin, double reach, Two solref,
             Five solimp, Two friction_solref) {
            to.pairs.push_back({geom_a, geom_b, dim, friction, margin, reach, {solref, solimp}, friction_solref});
          },
          nb::kw_only(), nb::arg("geom_a"), nb::arg("geom_b"), nb::arg("dim"), nb::arg("friction"), nb::arg("margin"),
          nb::arg("reach"), nb::arg("solref"), nb::arg("solimp"), nb::arg("friction_solref"))
      .def_rw("tendons", &D::tendons)
      .def(
          "add_tendon_term",
          [](D& to, Index tendon, Index joint, double coefficient) {
            to.tendon_terms.push_back({tendon, joint, coefficient});
          },
          nb::kw_only(), nb::arg("tendon"), nb::arg("joint"), nb::arg("coefficient"));
}

/// Arrays by the names that MuJoCo has for them.
constexpr std::pair<const char*, ObservedArray> kObservedNames[] = {{"xpos", ObservedArray::xpos},
                                                                    {"xipos", ObservedArray::xipos},
                                                                    {"cinert", ObservedArray::cinert},
                                                                    {"cvel", ObservedArray::cvel},
                                                                    {"qfrc_actuator", ObservedArray::qfrc_actuator},
                                                                    {"cfrc_ext", ObservedArray::cfrc_ext},
                                                                    {"ten_length", ObservedArray::ten_length},
                                                                    {"ten_velocity", ObservedArray::ten_velocity}};

nb::dict observed_of(nb::handle self) {
  nb::dict found;
  for (const auto& [name, which] : kObservedNames) found[name] = nb::cast<SharedRobots&>(self).observed(self, which);
  return found;
}

/// Arrays of constants by name, of the names given.
nb::dict varied_by_name(nb::handle self, const std::vector<std::string>& names) {
  nb::dict found;
  for (const auto& [name, which] : kVariedNames)
    for (const std::string& one : names)
      if (one == name) found[name] = nb::cast<SharedRobots&>(self).varied(self, which);
  return found;
}

}  // namespace

void bind_articulated(nb::module_& module) {
  bind_description(module);
  nb::class_<SharedRobots>(module, "ArticulatedBatch")
      .def(nb::init<const ArticulatedDescription&, Offset, double, Index, int, bool, const std::vector<std::string>&,
                    bool, const std::string&>(),
           nb::arg("description"), nb::arg("env_count"), nb::arg("tolerance"), nb::arg("max_iterations"),
           nb::arg("threads"), nb::arg("observes"), nb::arg("varies"), nb::arg("wide"), nb::arg("device"))
      .def("step", &SharedRobots::step, nb::arg("count") = 1, nb::arg("active").none() = nb::none())
      .def("forward", &SharedRobots::forward, nb::arg("active").none() = nb::none())
      .def("observed", &observed_of)
      .def("varied", &varied_by_name)
      .def("array", [](nb::handle self, const char* name) { return nb::cast<SharedRobots&>(self).array(self, name); })
      .def("status", [](nb::handle self) { return nb::cast<SharedRobots&>(self).status(self); })
      .def("hash", &SharedRobots::hash)
      .def("probe", &SharedRobots::probe);
}

}  // namespace stiction::python
