#include "stiction/articulated.hpp"

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <mutex>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "python/src/array.hpp"
#include "python/src/names.hpp"
#include "python/src/signal_check.hpp"
#include "python/src/solver.hpp"

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

/// Arrays by the names that MuJoCo has for them.
constexpr std::pair<const char*, ObservedArray> kObservedNames[] = {{"xpos", ObservedArray::xpos},
                                                                    {"xipos", ObservedArray::xipos},
                                                                    {"cinert", ObservedArray::cinert},
                                                                    {"cvel", ObservedArray::cvel},
                                                                    {"qfrc_actuator", ObservedArray::qfrc_actuator},
                                                                    {"cfrc_ext", ObservedArray::cfrc_ext},
                                                                    {"ten_length", ObservedArray::ten_length},
                                                                    {"ten_velocity", ObservedArray::ten_velocity}};

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
      : device_(Device::from_string(device)),
        robots_(made(device_, description, env_count, {tolerance, max_iterations, threads, observes, varied_of(varies)},
                     wide)) {}

  void step(std::int64_t count, const Array* active, std::uintptr_t stream) {
    visit([=, mask = mask_of("active", active)](auto& robots) {
      SignalCheck signals;
      // Robots of a pack make all steps of a call at once, so a long call is made of shorter ones.
      constexpr std::int64_t kMost = 16;
      for (std::int64_t done = 0; done < count; done += kMost) {
        robots.step(static_cast<Index>(count - done < kMost ? count - done : kMost), mask, stream_from(stream));
        signals.look();
      }
    });
  }

  void forward(const Array* active, std::uintptr_t stream) {
    visit([=, mask = mask_of("active", active)](auto& robots) { robots.forward(mask, stream_from(stream)); });
  }
  void reset(const Array& mask, std::uintptr_t stream) {
    visit([=, chosen = mask_of("mask", &mask)](auto& robots) { robots.reset(chosen, stream_from(stream)); });
  }
  /// Controls of the package's checks, in memory of the device.
  void copy_ctrl(const Array& ctrl, std::uintptr_t stream) {
    visit([&]<class Real>(ArticulatedBatch<Real>& robots) {
      robots.copy_ctrl(static_cast<const Real*>(ctrl.data()), stream_from(stream));
      if (device_.kind == DeviceKind::emulated) robots.synchronize();  // its queue holds no array
    });
  }

  /// An array of the batch by name, in host memory as steps have left it: NumPy's, which may be written. On a device it
  /// is a copy.
  nb::object array(nb::handle self, const std::string& name) {
    Found found{};
    visit([&]<class Real>(ArticulatedBatch<Real>& robots) {
      found = find(robots, name, static_cast<const ArticulatedView<Real>*>(nullptr));
    });
    return cast<nb::numpy>(self, found, {});
  }
  /// Memory of the device that steps read and write, with what was written in arrays of the host: what DLPack takes.
  nb::object memory(nb::handle self, const std::string& name, const std::vector<std::size_t>& shape) {
    Found found{};
    visit([&]<class Real>(ArticulatedBatch<Real>& robots) {
      const ArticulatedView<Real> there = robots.view();
      robots.synchronize();
      found = find(robots, name, &there);
      is_shared_ = true;
    });
    return cast<nb::array_api>(self, found, shape);
  }
  void synchronize() {
    visit([](auto& robots) { robots.synchronize(); });
  }
  /// Arrays of the host were written: who shares the device's memory is to see it.
  void give_back() {
    visit([&](auto& robots) {
      if (!is_shared_) return;
      static_cast<void>(robots.view());
      robots.synchronize();
    });
  }
  [[nodiscard]] Device device() const { return device_; }

  std::uint64_t hash() {
    std::uint64_t bits = 0;
    visit([&](auto& robots) { bits = robots.hash(); });
    return bits;
  }

  nb::dict probe() {
    ArticulatedProbe found;
    visit([&](auto& robots) { found = robots.probe(); });
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
  /// An array by name, and how many numbers an environment has in it.
  enum class Numbers : std::uint8_t { real, seconds, record };
  struct Found {
    void* data;
    std::size_t width;
    Numbers numbers;
  };
  /// `there`: the arrays in memory of the device; null: those of the host.
  template <class Real>
  static Found find(ArticulatedBatch<Real>& robots, const std::string& name, const ArticulatedView<Real>* there) {
    using Robots = ArticulatedBatch<Real>;
    using View = ArticulatedView<Real>;
    struct State {
      const char* name;
      std::span<Real> (Robots::*host)();
      Real* View::* there;
      Index (Robots::*width)() const;
    };
    constexpr State kStates[] = {{"qpos", &Robots::qpos, &View::qpos, &Robots::q_count},
                                 {"qvel", &Robots::qvel, &View::qvel, &Robots::dof_count},
                                 {"ctrl", &Robots::ctrl, &View::ctrl, &Robots::actuator_count},
                                 {"qfrc_applied", &Robots::qfrc_applied, &View::qfrc_applied, &Robots::dof_count},
                                 {"qacc", &Robots::qacc, &View::qacc, &Robots::dof_count}};
    for (const State& one : kStates)
      if (name == one.name)
        return {there != nullptr ? there->*one.there : (robots.*one.host)().data(),
                static_cast<std::size_t>((robots.*one.width)()), Numbers::real};
    for (const auto& [known, which] : kObservedNames)
      if (name == known)
        return {there != nullptr ? there->observed[static_cast<std::size_t>(which)] : robots.observed(which).data(),
                static_cast<std::size_t>(robots.observed_width(which)), Numbers::real};
    for (const auto& [known, which] : kVariedNames)
      if (name == known)
        return {there != nullptr ? there->varied[static_cast<std::size_t>(which)] : robots.varied(which).data(),
                static_cast<std::size_t>(robots.varied_width(which)), Numbers::real};
    if (name == "time") return {there != nullptr ? there->time : robots.time().data(), 1, Numbers::seconds};
    if (name == "status")
      return {there != nullptr ? there->status : const_cast<EnvStatus*>(robots.status().data()), sizeof(EnvStatus),
              Numbers::record};
    throw nb::value_error(("array: expected one of a batch of robots, got " + name).c_str());
  }

  /// An array of that shape, or else (envs, width), of NumPy's type, or of one that only has DLPack.
  template <class Framework>
  nb::object cast(nb::handle self, const Found& found, std::vector<std::size_t> shape) {
    constexpr bool kOnHost = std::is_same_v<Framework, nb::numpy>;
    const int type = !kOnHost && device_.kind == DeviceKind::cuda ? nb::device::cuda::value : nb::device::cpu::value;
    return std::visit(
        [&]<class Real>(const ArticulatedBatch<Real>& robots) {
          if (shape.empty()) shape = {static_cast<std::size_t>(robots.env_count()), found.width};
          const auto made = [&]<class T>(T) {
            return nb::cast(nb::ndarray<Framework, T>(found.data, shape.size(), shape.data(), self, nullptr,
                                                      nb::dtype<T>(), type, kOnHost ? 0 : device_.ordinal));
          };
          if (found.numbers == Numbers::seconds) return made(double{});
          if (found.numbers == Numbers::record) return made(std::uint8_t{});
          return made(Real{});
        },
        robots_);
  }

  /// Lets Python go on while a call runs, after those of other threads.
  template <class Call>
  void visit(const Call& call) {
    const nb::gil_scoped_release unlocked;
    const std::lock_guard lock(mutex_);
    std::visit(call, robots_);
  }
  static std::span<const std::uint8_t> mask_of(const char* name, const Array* mask) {
    if (mask == nullptr) return {};
    return {mask->read<std::uint8_t>(name), static_cast<std::size_t>(mask->size())};
  }
  using Either = std::variant<ArticulatedBatch<float>, ArticulatedBatch<double>>;
  static Either made(Device device, const ArticulatedDescription& description, Offset env_count,
                     const ArticulatedOptions& options, bool wide) {
    if (wide) return ArticulatedBatch<double>(device, description, env_count, options);
    return ArticulatedBatch<float>(device, description, env_count, options);
  }

  std::mutex mutex_;
  Device device_;
  Either robots_;
  bool is_shared_ = false;  ///< another library has memory of the device
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
          [](D& to, Index body, int kind, Three size, Three position, Four orientation, Index field, Index hull) {
            to.geoms.push_back({body, static_cast<GeomKind>(kind), size, position, orientation, field, hull});
          },
          nb::kw_only(), nb::arg("body"), nb::arg("kind"), nb::arg("size"), nb::arg("position"), nb::arg("orientation"),
          nb::arg("field"), nb::arg("hull"))
      .def(
          "add_hull",
          [](D& to, std::vector<Three> vertices, std::vector<Index> face_begin, std::vector<Index> corners) {
            to.hulls.push_back({std::move(vertices), std::move(face_begin), std::move(corners)});
          },
          nb::kw_only(), nb::arg("vertices"), nb::arg("face_begin"), nb::arg("corners"))
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

}  // namespace

void bind_articulated(nb::module_& module) {
  bind_description(module);
  nb::class_<SharedRobots>(module, "ArticulatedBatch")
      .def(nb::init<const ArticulatedDescription&, Offset, double, Index, int, bool, const std::vector<std::string>&,
                    bool, const std::string&>(),
           nb::arg("description"), nb::arg("env_count"), nb::arg("tolerance"), nb::arg("max_iterations"),
           nb::arg("threads"), nb::arg("observes"), nb::arg("varies"), nb::arg("wide"), nb::arg("device"))
      .def("step", &SharedRobots::step, nb::arg("count") = 1, nb::arg("active").none() = nb::none(),
           nb::arg("stream") = 0)
      .def("forward", &SharedRobots::forward, nb::arg("active").none() = nb::none(), nb::arg("stream") = 0)
      .def("reset", &SharedRobots::reset, nb::arg("mask"), nb::arg("stream"))
      .def("copy_ctrl", &SharedRobots::copy_ctrl, nb::arg("ctrl"), nb::arg("stream"))
      .def("give_back", &SharedRobots::give_back)
      .def("synchronize", &SharedRobots::synchronize)
      .def("array",
           [](nb::handle self, const std::string& name) { return nb::cast<SharedRobots&>(self).array(self, name); })
      .def("memory",
           [](nb::handle self, const std::string& name, const std::vector<std::size_t>& shape) {
             return nb::cast<SharedRobots&>(self).memory(self, name, shape);
           })
      .def_prop_ro("device", [](const SharedRobots& self) { return name_of(self.device()); })
      .def("hash", &SharedRobots::hash)
      .def("probe", &SharedRobots::probe);
}

}  // namespace stiction::python
