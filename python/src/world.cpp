#include "stiction/world.hpp"

#include <nanobind/stl/array.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>

#include <algorithm>
#include <memory>

#include "python/src/names.hpp"
#include "python/src/signal_check.hpp"
#include "python/src/solver.hpp"
#include "python/src/world_description.hpp"
#include "stiction/world_derivative.hpp"

namespace nb = nanobind;

namespace stiction::python {

namespace {

/// Returns copies of a world's arrays, as NumPy arrays that own them.
template <class T>
nb::object as_numpy(std::vector<T> values) {
  auto* const kept = new std::vector<T>(std::move(values));
  const nb::capsule owner(kept, [](void* memory) noexcept { delete static_cast<std::vector<T>*>(memory); });
  return nb::cast(nb::ndarray<nb::numpy, T, nb::ndim<1>>(kept->data(), {kept->size()}, owner));
}

template <class T>
std::vector<T> copied(const T* from, Offset count) {
  return {from, from + count};
}

template <class Real>
std::span<const Real> span_of(const Array& array, const char* name) {
  return {array.read<Real>(name), static_cast<std::size_t>(array.size())};
}

/// A step of a world in either precision, that was kept for its derivative.
struct KeptStep {
  std::variant<WorldStep<float>, WorldStep<double>> step;

  nb::dict pull(const Array& twist, const Array& position) const {
    return std::visit(
        [&]<class Real>(const WorldStep<Real>& kept) {
          const std::span<const Real> by_twist = span_of<Real>(twist, "twist");
          const std::span<const Real> by_position = span_of<Real>(position, "position");
          WorldGradient<Real> found;
          {
            const nb::gil_scoped_release unlocked;
            found = kept.pull(by_twist, by_position);
          }
          nb::dict to;
          to["position"] = as_numpy(std::move(found.position));
          to["twist"] = as_numpy(std::move(found.twist));
          to["wrench"] = as_numpy(std::move(found.wrench));
          to["friction"] = as_numpy(std::move(found.friction));
          to["contact_mu"] = as_numpy(std::move(found.contact_mu));
          to["depth"] = as_numpy(std::move(found.depth));
          const auto* const bytes = reinterpret_cast<const std::uint8_t*>(found.status.data());
          to["status"] = as_numpy(copied(bytes, static_cast<Offset>(found.status.size() * sizeof(GradientStatus))));
          return to;
        },
        step);
  }
};

/// Bodies and contacts of a world's last step, copied while nothing else runs in it.
template <class Real>
struct CopiedContacts {
  std::vector<Offset> offsets;
  std::vector<Index> body_a, body_b;
  std::vector<Real> arm_a, arm_b, normal, mu, depth, restitution, impulse, inv_mass, inv_inertia;
  std::vector<std::uint64_t> id;

  explicit CopiedContacts(const World<Real>& world) {
    const BodyBatchView<Real> from = world.contacts();
    const Offset count = from.contact_count, bodies = from.body_count;
    offsets = copied(from.env_contact_offsets, from.env_count + 1);
    body_a = copied(from.body_a, count);
    body_b = copied(from.body_b, count);
    arm_a = copied(from.arm_a, 3 * count);
    arm_b = copied(from.arm_b, 3 * count);
    normal = copied(from.normal, 3 * count);
    mu = copied(from.mu, count);
    depth = copied(from.depth, count);
    restitution = copied(from.restitution, count);
    id = copied(from.contact_id, count);
    impulse = copied(world.impulses().data(), 3 * count);
    inv_mass = copied(from.inv_mass, bodies);
    inv_inertia = copied(from.inv_inertia, 6 * bodies);
  }

  nb::dict to_dict() && {
    nb::dict to;
    to["offsets"] = as_numpy(std::move(offsets));
    to["body_a"] = as_numpy(std::move(body_a));
    to["body_b"] = as_numpy(std::move(body_b));
    to["arm_a"] = as_numpy(std::move(arm_a));
    to["arm_b"] = as_numpy(std::move(arm_b));
    to["normal"] = as_numpy(std::move(normal));
    to["mu"] = as_numpy(std::move(mu));
    to["depth"] = as_numpy(std::move(depth));
    to["restitution"] = as_numpy(std::move(restitution));
    to["id"] = as_numpy(std::move(id));
    to["impulse"] = as_numpy(std::move(impulse));
    to["inv_mass"] = as_numpy(std::move(inv_mass));
    to["inv_inertia"] = as_numpy(std::move(inv_inertia));
    return to;
  }
};

/// A World in either precision, whose calls wait for one another. Lengths of arrays are the package's business.
class SharedWorld {
 public:
  SharedWorld(Device device, WorldDescription description, Offset env_count, const WorldOptions& options, bool wide)
      : device_(device) {
    if (wide)
      world_.emplace<World<double>>(device, std::move(description), env_count, options);
    else
      world_.emplace<World<float>>(device, std::move(description), env_count, options);
  }

  void step(const Array* wrench, std::int64_t count) {
    visit([&]<class Real>(World<Real>& world) {
      const Real* const force = given<Real>(wrench, "wrench");
      return [=, this, &world] {
        push(world, force);
        SignalCheck signals;
        for (std::int64_t k = 0; k < count; ++k) {
          world.step();
          signals.look();
        }
      };
    });
  }

  KeptStep keep(const Array* wrench, const DerivativeOptions& options) {
    std::unique_ptr<KeptStep> kept;
    visit([&]<class Real>(World<Real>& world) {
      const Real* const force = given<Real>(wrench, "wrench");
      return [=, this, &world, &kept, &options] {
        push(world, force);
        kept = std::make_unique<KeptStep>(KeptStep{WorldStep<Real>(world, options)});
      };
    });
    return std::move(*kept);
  }

  void state(const Array& position, const Array& orientation, const Array& twist) {
    visit([&]<class Real>(World<Real>& world) {
      Real* const to[] = {position.write<Real>("position"), orientation.write<Real>("orientation"),
                          twist.write<Real>("twist")};
      return [=, &world] {
        const WorldState<Real> now = world.state();
        std::copy(now.position.begin(), now.position.end(), to[0]);
        std::copy(now.orientation.begin(), now.orientation.end(), to[1]);
        std::copy(now.twist.begin(), now.twist.end(), to[2]);
      };
    });
  }

  /// The world keeps its own where an array is not given; if none is, it takes the description's.
  void reset(const Array& mask, const Array* position, const Array* orientation, const Array* twist) {
    visit([&]<class Real>(World<Real>& world) {
      const std::span<const std::uint8_t> chosen = span_of<std::uint8_t>(mask, "mask");
      const Real* const from[] = {given<Real>(position, "position"), given<Real>(orientation, "orientation"),
                                  given<Real>(twist, "twist")};
      return [=, &world] {
        if (from[0] == nullptr && from[1] == nullptr && from[2] == nullptr) {
          world.reset(chosen);
          return;
        }
        const WorldState<Real> now = world.state();
        const auto either = [](const Real* other, std::span<const Real> own) {
          return other == nullptr ? std::vector<Real>(own.begin(), own.end())
                                  : copied(other, static_cast<Offset>(own.size()));
        };
        const std::vector<Real> places = either(from[0], now.position), turns = either(from[1], now.orientation),
                                twists = either(from[2], now.twist);
        world.reset(chosen, WorldState<Real>{places, turns, twists});
      };
    });
  }

  nb::dict checkpoint() {
    std::variant<std::monostate, WorldCheckpoint<float>, WorldCheckpoint<double>> found;
    visit([&]<class Real>(World<Real>& world) { return [&] { found = world.checkpoint(); }; });
    nb::dict to;
    std::visit(
        [&]<class Held>(Held& held) {
          if constexpr (!std::is_same_v<Held, std::monostate>) {
            to["position"] = as_numpy(std::move(held.position));
            to["orientation"] = as_numpy(std::move(held.orientation));
            to["twist"] = as_numpy(std::move(held.twist));
            to["contact_offsets"] = as_numpy(std::move(held.contact_offsets));
            to["contact_id"] = as_numpy(std::move(held.contact_id));
            to["impulse"] = as_numpy(std::move(held.impulse));
          }
        },
        found);
    return to;
  }

  /// Forces are given with each step, so a checkpoint has none.
  void resume(const Array& position, const Array& orientation, const Array& twist, const Array& contact_offsets,
              const Array& contact_id, const Array& impulse) {
    visit([&]<class Real>(World<Real>& world) {
      const auto vector_of = [](const auto& span) { return std::vector(span.begin(), span.end()); };
      auto from = std::make_shared<WorldCheckpoint<Real>>();
      from->position = vector_of(span_of<Real>(position, "position"));
      from->orientation = vector_of(span_of<Real>(orientation, "orientation"));
      from->twist = vector_of(span_of<Real>(twist, "twist"));
      from->wrench.assign(from->twist.size(), Real(0));
      from->contact_offsets = vector_of(span_of<Offset>(contact_offsets, "contact_offsets"));
      from->contact_id = vector_of(span_of<std::uint64_t>(contact_id, "contact_id"));
      from->impulse = vector_of(span_of<Real>(impulse, "impulse"));
      return [this, from, &world] {
        world.resume(*from);
        is_pushed_ = false;
      };
    });
  }

  void status(const Array& to) {
    visit([&]<class Real>(World<Real>& world) {
      auto* const records = reinterpret_cast<EnvStatus*>(to.write<std::uint8_t>("status"));
      return [=, &world] {
        const std::span<const EnvStatus> now = world.status();
        std::copy(now.begin(), now.end(), records);
      };
    });
  }

  nb::dict contacts() {
    std::variant<std::monostate, CopiedContacts<float>, CopiedContacts<double>> found;
    visit([&]<class Real>(World<Real>& world) { return [&] { found.emplace<CopiedContacts<Real>>(world); }; });
    return std::visit(
        []<class Copied>(Copied& copied) {
          if constexpr (std::is_same_v<Copied, std::monostate>)
            return nb::dict();
          else
            return std::move(copied).to_dict();
        },
        found);
  }

  /// Eight numbers of each environment: energies, momentum, angular momentum.
  void motion(const Array& to) {
    visit([&]<class Real>(World<Real>& world) {
      double* out = to.write<double>("motion");
      return [=, &world]() mutable {
        for (const WorldMotion& motion : world.motion()) {
          *out++ = motion.kinetic;
          *out++ = motion.potential;
          out = std::copy_n(motion.momentum, 3, out);
          out = std::copy_n(motion.angular_momentum, 3, out);
        }
      };
    });
  }

  std::uint64_t hash() {
    std::uint64_t bits = 0;
    visit([&]<class Real>(World<Real>& world) { return [&] { bits = world.hash(); }; });
    return bits;
  }

  WorldSeconds seconds() {
    WorldSeconds spent;
    visit([&]<class Real>(World<Real>& world) { return [&] { spent = world.seconds(); }; });
    return spent;
  }

  [[nodiscard]] Device device() const { return device_; }

 private:
  template <class Real>
  static const Real* given(const Array* array, const char* name) {
    return array == nullptr ? nullptr : array->read<Real>(name);
  }

  /// Gives the steps to come these forces, or none. A world on a device copies them in every step once they were asked
  /// for, so nothing is asked for until a force is given.
  template <class Real>
  void push(World<Real>& world, const Real* force) {
    if (force == nullptr && !is_pushed_) return;
    const std::span<Real> to = world.wrench();
    if (force == nullptr)
      std::fill(to.begin(), to.end(), Real(0));
    else
      std::copy_n(force, to.size(), to.begin());
    is_pushed_ = force != nullptr;
  }

  /// Reads arrays while Python waits, by prepare(world), and lets Python go on while the returned work runs.
  template <class Prepare>
  void visit(const Prepare& prepare) {
    std::visit(
        [&]<class Held>(Held& world) {
          if constexpr (!std::is_same_v<Held, std::monostate>) {
            auto call = prepare(world);
            const nb::gil_scoped_release unlocked;
            const std::lock_guard lock(mutex_);
            call();
          }
        },
        world_);
  }

  std::mutex mutex_;
  Device device_;
  std::variant<std::monostate, World<float>, World<double>> world_;
  bool is_pushed_ = false;
};

WorldOptions options_from(const BodyOptions& options, double margin, double warm_start) {
  WorldOptions world;
  world.stepping = options.stepping;
  world.solver = options.solver;
  world.margin = margin;
  world.warm_start = warm_start;
  return world;
}

}  // namespace

void bind_world(nb::module_& module) {
  module.def(
      "until_solved",
      [](bool wide) {
        const BodySolverOptions options = wide ? until_solved<double>() : until_solved<float>();
        return std::pair(options.iterations, options.tolerance);
      },
      nb::arg("wide"), "(iterations, tolerance) of a world by default.");
  module.def("slowest_bounce", &slowest_bounce, nb::arg("gravity"), nb::arg("dt"),
             "restitution_threshold of a world by default [m/s].");
  nb::class_<KeptStep>(module, "WorldStep", "A step of a world, kept for its derivative.")
      .def("pull", &KeptStep::pull, nb::arg("twist"), nb::arg("position"));
  nb::class_<SharedWorld>(module, "World", "Worlds of rigid bodies on one device.")
      .def(
          "__init__",
          [](SharedWorld* self, const std::string& device, const nb::sequence& bodies, const nb::sequence& shapes,
             const std::array<double, 3>& gravity, Offset env_count, const BodyOptions& options, double margin,
             double warm_start, bool wide) {
            new (self) SharedWorld(Device::from_string(device), description_from(bodies, shapes, gravity), env_count,
                                   options_from(options, margin, warm_start), wide);
          },
          nb::arg("device"), nb::arg("bodies"), nb::arg("shapes"), nb::arg("gravity"), nb::arg("env_count"),
          nb::arg("options"), nb::arg("margin"), nb::arg("warm_start"), nb::arg("wide"))
      .def("step", &SharedWorld::step, nb::arg("wrench").none(), nb::arg("count"))
      .def(
          "keep",
          [](SharedWorld& self, const Array* wrench, double residual_limit, double tie_tolerance, Index max_unknowns,
             int threads, double kappa) {
            DerivativeOptions options;
            options.residual_limit = residual_limit;
            options.tie_tolerance = tie_tolerance;
            options.max_unknowns = max_unknowns;
            options.threads = threads;
            options.kappa = kappa;
            return self.keep(wrench, options);
          },
          nb::arg("wrench").none(), nb::arg("residual_limit"), nb::arg("tie_tolerance"), nb::arg("max_unknowns"),
          nb::arg("threads"), nb::arg("kappa"))
      .def("state", &SharedWorld::state, nb::arg("position"), nb::arg("orientation"), nb::arg("twist"))
      .def("reset", &SharedWorld::reset, nb::arg("mask"), nb::arg("position").none(), nb::arg("orientation").none(),
           nb::arg("twist").none())
      .def("checkpoint", &SharedWorld::checkpoint)
      .def("resume", &SharedWorld::resume, nb::arg("position"), nb::arg("orientation"), nb::arg("twist"),
           nb::arg("contact_offsets"), nb::arg("contact_id"), nb::arg("impulse"))
      .def("status", &SharedWorld::status, nb::arg("status"))
      .def("contacts", &SharedWorld::contacts)
      .def("motion", &SharedWorld::motion, nb::arg("motion"))
      .def("hash", &SharedWorld::hash)
      .def("seconds",
           [](SharedWorld& self) {
             const WorldSeconds spent = self.seconds();
             nb::dict to;
             to["detect"] = spent.detect;
             to["plan"] = spent.plan;
             to["solve"] = spent.solve;
             to["integrate"] = spent.integrate;
             return to;
           })
      .def_prop_ro(
          "device", [](const SharedWorld& self) { return name_of(self.device()); }, "The device that \"auto\" became.");
  module.def(
      "solid_body",
      [](nb::handle shape, double density) {
        const WorldBody body = solid_body(shape_from(shape), density);
        return nb::make_tuple(body.mass, body.inertia, body.position, body.orientation);
      },
      nb::arg("shape"), nb::arg("density"), "Mass, moments, centre and axes of a solid of that shape.");
}

}  // namespace stiction::python
