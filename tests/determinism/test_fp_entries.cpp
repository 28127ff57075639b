// Every public function that computes with numbers, under every rounding mode and with subnormals flushed or not. The
// caller's modes reach no bit and are left unchanged. A new public function that computes belongs into the table.
#include <gtest/gtest.h>

#include <cfenv>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <map>
#include <span>

#include "stiction/analysis.hpp"
#include "stiction/contact_graph.hpp"
#include "stiction/error.hpp"
#include "stiction/jacobian_solver.hpp"
#include "stiction/pyramid.hpp"
#include "stiction/residual.hpp"
#include "stiction/stepping.hpp"
#include "tests/support/machines/flush_modes.hpp"
#include "tests/support/systems/body_systems.hpp"
#include "tests/support/systems/derivative_cases.hpp"
#include "tests/support/systems/jacobian_systems.hpp"
#include "tests/support/systems/scene_batches.hpp"
#include "tests/support/systems/worlds.hpp"
#if defined(STICTION_TEST_HAS_IO)
#include "stiction/io.hpp"
#include "stiction/recorder.hpp"
#endif

namespace stiction::test {
namespace {

/// Everything that a call returned, byte by byte.
class Bytes {
 public:
  template <class T>
  Bytes& operator<<(const std::vector<T>& values) {
    return *this << std::span<const T>(values);
  }
  template <class T>
  Bytes& operator<<(std::span<const T> values) {
    text_.append(reinterpret_cast<const char*>(values.data()), values.size_bytes());
    return *this;
  }
  Bytes& operator<<(const std::string& text) {
    text_ += text;
    return *this;
  }
  template <class T>
    requires std::is_arithmetic_v<T>
  Bytes& operator<<(T value) {
    return *this << std::span<const T>(&value, 1);
  }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  std::string text_;
};

using Entry = std::function<Bytes()>;
using Table = std::map<std::string, Entry>;

/// Numbers with bits to round off, some of them subnormal in the precision they are rounded to.
const ContactBatch<double>& doubles() {
  static const ContactBatch<double> batch = [] {
    auto arrays = scene_batch("walker", 5, 9).arrays();
    for (std::size_t i = 0; i < arrays.b.size(); i += 3) arrays.b[i] *= 0x1p-140;
    for (double& value : arrays.R) value = value * 1.1 + 1e-5;
    for (double& value : arrays.mu) value *= 1.0 / 3;
    return ContactBatch<double>::from_arrays(Law::coulomb, arrays);
  }();
  return batch;
}

const ContactBatch<float>& floats() {
  static const ContactBatch<float> batch = convert<float>(doubles());
  return batch;
}

template <class Real>
const ContactBatch<Real>& batch_for() {
  if constexpr (std::is_same_v<Real, float>) {
    return floats();
  } else {
    return doubles();
  }
}

template <class Real>
Bytes bytes_of(const Solution<Real>& solution) {
  Bytes bytes;
  bytes << solution.lambda << solution.w << solution.status;
  return bytes;
}

SolverOptions sweeps(SolverKind solver) {
  SolverOptions o = options(solver, 1e-7, 12);
  o.omega = 1.1;  // no float is 1.1
  return o;
}

template <class Real>
void add_contacts(Table& table, const std::string& precision) {
  const auto add = [&](const std::string& name, const Entry& entry) { table[name + " " + precision] = entry; };
  for (const SolverKind solver : kEverySolver) {
    add(std::string("solve ") + to_string(solver),
        [solver] { return bytes_of(solve(batch_for<Real>(), sweeps(solver))); });
  }
  add("solve auto", [] { return bytes_of(solve(batch_for<Real>(), sweeps(SolverKind::automatic))); });
  add("solve islands apart", [] {
    SolverOptions o = sweeps(SolverKind::npgs);
    o.islands = IslandMode::apart;
    return bytes_of(solve(batch_for<Real>(), o));
  });
  add("linearise", [] {
    const auto pyramids = linearise(batch_for<Real>(), 8);
    Bytes bytes;
    bytes << pyramids.batch.arrays().A << pyramids.batch.arrays().b << pyramids.batch.arrays().R;
    const std::vector<Real> f(static_cast<std::size_t>(pyramids.batch.row_count()), Real(1) / 3);
    const auto back = reactions(pyramids, batch_for<Real>(), std::span<const Real>(f));
    bytes << back.lambda << back.w;
    return bytes;
  });
  add("verify", [] {
    const std::vector<Real> lambda(static_cast<std::size_t>(batch_for<Real>().row_count()), Real(1) / 3);
    return Bytes() << verify(batch_for<Real>().view(), std::span<const Real>(lambda));
  });
  add("analyse", [] {
    Bytes bytes;
    for (const OperatorAnalysis& seen : analyse(batch_for<Real>().view()))
      bytes << seen.largest << seen.smallest << seen.rank;
    return bytes;
  });
  add("asymmetry", [] { return Bytes() << asymmetry(batch_for<Real>().view()); });
  add("validate", [] {
    auto arrays = batch_for<Real>().arrays();
    arrays.R.assign(arrays.R.size(), -std::numeric_limits<Real>::denorm_min());
    Bytes bytes;
    for (const Defect& defect : validate(ContactBatch<Real>::from_arrays(Law::convex, arrays).view()))
      bytes << defect.message;
    return bytes;
  });
  add("set_dense", [] {
    Environment<Real> environment;
    const Real tiny = std::numeric_limits<Real>::denorm_min();
    environment.set_dense(std::array<Real, 4>{1, tiny, tiny, 1}, 2);
    return Bytes() << environment.A;
  });
  add("stepping", [] {
    const auto view = batch_for<Real>().view();
    SteppingSolver<Real> solver(Device::cpu(), sweeps(SolverKind::npgs), Capacity::of(view), {.beta = 0.7});
    std::vector<std::uint64_t> id(static_cast<std::size_t>(view.cone_count));
    for (std::size_t k = 0; k < id.size(); ++k) id[k] = k;
    const auto rows = static_cast<std::size_t>(view.row_count);
    Solution<Real> solution{std::vector<Real>(rows), std::vector<Real>(rows),
                            std::vector<EnvStatus>(static_cast<std::size_t>(view.env_count))};
    for (const double dt : {0.003, 0.0071})
      solver.solve(view, id.data(), dt, {solution.lambda.data(), solution.w.data(), solution.status.data()});
    return bytes_of(solution);
  });
}

template <class Real>
JacobianBatch<Real> jacobians() {
  JacobianBatch<Real> batch(Law::coulomb);
  for (std::uint64_t seed = 1; seed < 4; ++seed) {
    const JacobianEnvironment<double> from = random_jacobian({.seed = seed});
    JacobianEnvironment<Real> env;
    for (const auto& cone : from.cones) env.cones.push_back({cone.kind, cone.row_count, cone.group});
    const auto fill = [](const std::vector<double>& source, std::vector<Real>& target) {
      for (const double value : source) target.push_back(static_cast<Real>(value));
    };
    fill(from.J, env.J), fill(from.M, env.M), fill(from.v_free, env.v_free), fill(from.target, env.target);
    fill(from.R, env.R), fill(from.mu, env.mu);
    batch.add(env);
  }
  return batch;
}

template <class Real>
void add_derivatives(Table& table, const std::string& precision) {
  const auto add = [&](const std::string& name, const Entry& entry) { table[name + " " + precision] = entry; };
  static const DerivativeOptions o{{}, std::numeric_limits<double>::infinity(), 1e-6, 1024, 2};
  add("vjp", [] {
    const auto solution = solve(batch_for<Real>(), sweeps(SolverKind::npgs));
    const auto own = vjp(batch_for<Real>().view(), solution.lambda, solution.w, solution.w, o);
    return Bytes() << own.all() << own.status;
  });
  add("jvp", [] {
    const auto view = batch_for<Real>().view();
    const auto solution = solve(batch_for<Real>(), sweeps(SolverKind::npgs));
    const auto own = jvp(view, solution.lambda,
                         BatchTangentView<Real>{view.A, nullptr, view.b, view.R, view.mu, nullptr, nullptr}, o);
    return Bytes() << own.lambda << own.w << own.status;
  });
  add("vjp jacobian", [] {
    static const JacobianBatch<Real> batch = jacobians<Real>();
    const auto view = batch.view();
    const auto solution = solve(batch, sweeps(SolverKind::npgs));
    const auto size = [](Offset count) { return std::vector<Real>(static_cast<std::size_t>(count)); };
    auto J = size(view.entry_count), M = size(view.mass_count), v_free = size(view.dof_count), R = size(view.row_count);
    std::vector<GradientStatus> status(solution.contact.status.size());
    Derivative(Device::cpu(), o)
        .vjp(view, ReactionView<Real>{solution.contact.lambda.data(), nullptr},
             JacobianSolutionCotangentView<Real>{solution.contact.w.data(), nullptr, solution.velocity.data()},
             JacobianBatchCotangentView<Real>{J.data(), M.data(), v_free.data(), nullptr, R.data(), nullptr, nullptr,
                                              nullptr},
             status.data());
    return Bytes() << J << M << v_free << R << status;
  });
}

template <class Real>
void add_other_forms(Table& table, const std::string& precision) {
  const auto add = [&](const std::string& name, const Entry& entry) { table[name + " " + precision] = entry; };
  static const JacobianBatch<Real> jacobian = jacobians<Real>();
  for (const FactorUse use : {FactorUse::never, FactorUse::always}) {
    const std::string form = use == FactorUse::never ? "matrix" : "factor";
    add("assemble " + form, [use] {
      const ContactBatch<Real> batch = assemble(jacobian.view(), use);
      return Bytes() << batch.arrays().A << batch.arrays().factor << batch.arrays().b;
    });
    add("solve jacobian " + form, [use] {
      const auto solution = solve(jacobian, sweeps(SolverKind::npgs), Device::cpu(), {}, use);
      return bytes_of(solution.contact) << solution.velocity;
    });
  }
  add("velocities", [] {
    const std::vector<Real> lambda(static_cast<std::size_t>(jacobian.row_count()), Real(1) / 3);
    return Bytes() << velocities(jacobian.view(), std::span<const Real>(lambda));
  });
  static const BodyBatch<Real> bodies =
      batch_of<Real>({as<Real>(random_bodies(1, 5, 20)), as<Real>(random_bodies(2, 7, 31))});
  for (const BodyMethod method : {BodyMethod::impulses, BodyMethod::newton}) {
    add(method == BodyMethod::impulses ? "bodies impulses" : "bodies newton", [method] {
      BodySolverOptions o;
      o.method = method;
      o.iterations = 12;
      o.max_contacts_per_env = 25;
      const auto solution = solve_bodies(bodies, {}, o);
      return Bytes() << solution.impulse << solution.twist << solution.w << solution.status;
    });
  }
  add("world", [] {
    WorldOptions o;
    o.solver.threads = 1;
    World<Real> world = started<Real>("pile", 2, o);
    run(world, 40);
    Bytes bytes;
    bytes << world.hash();
    for (const WorldMotion& motion : world.motion()) bytes << motion.kinetic << motion.potential;
    return bytes;
  });
}

#if defined(STICTION_TEST_HAS_IO)
std::string contents(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

void add_files(Table& table) {
  const auto folder = std::filesystem::temp_directory_path() / ("stiction_modes_" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  table["write_batch, read_batch"] = [folder] {
    io::Recording recording;
    recording.batch = doubles();
    io::write_batch(folder / "batch.h5", recording);
    const io::Recording back = io::read_batch(folder / "batch.h5");
    return Bytes() << contents(folder / "batch.h5") << back.batch.arrays().A << back.batch.arrays().b;
  };
  table["write_solution, read_solution"] = [folder] {
    io::SolutionFile solution;
    solution.precision = Precision::f32;
    solution.lambda.assign(4, static_cast<double>(1.0F / 3));
    io::write_solution(folder / "solution.h5", solution);
    return Bytes() << io::read_solution(folder / "solution.h5").lambda;
  };
  // The condensed operator of a recorded global problem is a sum of products and quotients.
  const auto global = std::filesystem::path(STICTION_SHARED_DIR) / "data" / "fclib";
  if (!std::filesystem::is_directory(global)) return;
  for (const auto& file : std::filesystem::directory_iterator(global)) {
    if (file.file_size() > 3'000'000) continue;
    table["read " + file.path().filename().string()] = [path = file.path()] {
      try {
        const io::Recording recording = io::read_batch(path);
        return Bytes() << recording.batch.arrays().A << recording.batch.arrays().b << recording.v_free;
      } catch (const Error& error) {
        return Bytes() << std::string(error.what());
      }
    };
  }
}
#endif

Table entries() {
  Table table;
  table["convert"] = [] {
    const auto batch = convert<float>(doubles());
    return Bytes() << batch.arrays().A << batch.arrays().b << batch.arrays().R << batch.arrays().mu;
  };
  table["solid_body"] = [] {
    const WorldBody body = solid_body(world_shape(0, ShapeKind::capsule, {0.1, 0.3, 0}), 1000.0 / 3);
    return Bytes() << body.mass << std::span<const double>(body.inertia);
  };
  table["contact graph"] = [] {
    ContactGraph graph;
    for (Index body = 0; body < 9; ++body) graph.add_body(body);
    for (Index body = 0; body < 8; ++body)
      graph.add_contact({static_cast<std::uint64_t>(body), body, static_cast<Index>(body + 1)});
    return Bytes() << laplacian_spectrum(graph) << graph.statistics().density << to_svg(graph) << to_dot(graph);
  };
  add_contacts<float>(table, "f32");
  add_contacts<double>(table, "f64");
  add_derivatives<float>(table, "f32");
  add_derivatives<double>(table, "f64");
  add_other_forms<float>(table, "f32");
  add_other_forms<double>(table, "f64");
#if defined(STICTION_TEST_HAS_IO)
  add_files(table);
#endif
  return table;
}

/// A rounding mode and the treatment of subnormals, as the caller has them.
struct Modes {
  int rounding;
  unsigned flush;  ///< one of kFlushModes, or 0

  void set() const {
    std::fesetround(rounding);
    set_fp_control(fp_control() | flush);
  }
  [[nodiscard]] bool are_set() const { return (fp_control() & kFlushBits) == flush && std::fegetround() == rounding; }
  [[nodiscard]] std::string text() const {
    return "rounding " + std::to_string(rounding) + ", flush " + std::to_string(flush);
  }
};

std::vector<Modes> all_modes() {
  std::vector<Modes> all;
  for (const int rounding : {FE_TONEAREST, FE_UPWARD, FE_DOWNWARD, FE_TOWARDZERO}) {
    all.push_back({rounding, 0});
    for (const unsigned flush : kFlushModes) all.push_back({rounding, flush});
  }
  return all;
}

class FpEntries : public testing::Test {
 protected:
  FpEntries() { std::fegetenv(&saved_); }
  ~FpEntries() override { std::fesetenv(&saved_); }
  void restore() const { std::fesetenv(&saved_); }

 private:
  std::fenv_t saved_{};
};

TEST_F(FpEntries, TheCallersModesReachNoBitOfAnyEntryAndAreLeftAsTheyWere) {
  for (const auto& [name, entry] : entries()) {
    const std::string expected = entry().text();
    ASSERT_FALSE(expected.empty()) << name;
    for (const Modes& modes : all_modes()) {
      modes.set();
      const std::string found = entry().text();
      const bool kept = modes.are_set();
      restore();
      EXPECT_TRUE(found == expected) << name << ", " << modes.text();
      EXPECT_TRUE(kept) << name << ", " << modes.text();
    }
  }
}

TEST_F(FpEntries, ARefusalLeavesTheModesAsTheyWere) {
  const Modes modes{FE_UPWARD, all_modes().back().flush};
  modes.set();
  EXPECT_THROW(linearise(doubles(), 5), Error);
  EXPECT_THROW(verify(doubles().view(), std::span<const double>()), Error);
  const bool kept = modes.are_set();
  restore();
  EXPECT_TRUE(kept);
}

}  // namespace
}  // namespace stiction::test
