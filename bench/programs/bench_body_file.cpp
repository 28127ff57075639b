// Sequential impulses of the body form on scenes in the file that physics engines get (bench/peers/engine_run.hpp).
// All environments are one batch, on one thread. bench/peers/engines.py calls it like the programs around engines:
//
//   bench_body_file SOLVER ITERATIONS SECONDS IN OUT
//
// SOLVER: si_f32, si_f64, momentum_f32, momentum_f64. Every environment's time is its share of the call, the median of
// calls.

#include <array>
#include <cstdio>
#include <string>
#include <vector>

#include "bench/peers/engine_run.hpp"
#include "bench/support/table_main.hpp"
#include "stiction/stiction.hpp"

namespace stiction::bench {

namespace {

template <class Real>
std::array<Real, 3> rounded(const double* v) {
  return {static_cast<Real>(v[0]), static_cast<Real>(v[1]), static_cast<Real>(v[2])};
}

/// xx xy xz yy yz zz of the inverse of a symmetric matrix.
template <class Real>
std::array<Real, 6> inverse(const double* m) {
  const double xx = m[4] * m[8] - m[5] * m[5], xy = m[2] * m[5] - m[1] * m[8], xz = m[1] * m[5] - m[2] * m[4];
  const double yy = m[0] * m[8] - m[2] * m[2], yz = m[1] * m[2] - m[0] * m[5], zz = m[0] * m[4] - m[1] * m[1];
  const double determinant = m[0] * xx + m[1] * xy + m[2] * xz;
  std::array<Real, 6> all{};
  const double cofactors[] = {xx, xy, xz, yy, yz, zz};
  for (std::size_t i = 0; i < 6; ++i) all[i] = static_cast<Real>(cofactors[i] / determinant);
  return all;
}

template <class Real>
BodyEnvironment<Real> environment(const engines::Scene& scene) {
  BodyEnvironment<Real> env;
  for (const engines::Body& given : scene.bodies) {
    auto& body = env.bodies.emplace_back();
    body.inv_mass = static_cast<Real>(1 / given.mass);
    body.inv_inertia = inverse<Real>(given.inertia);
    for (std::size_t i = 0; i < 6; ++i) body.twist[i] = static_cast<Real>(given.twist[i]);
  }
  for (const engines::Contact& given : scene.contacts) {
    auto& contact = env.contacts.emplace_back();
    contact.body_a = static_cast<Index>(given.a);
    contact.body_b = static_cast<Index>(given.b);
    contact.normal = rounded<Real>(given.normal);
    contact.mu = static_cast<Real>(given.mu);
    const auto arm = [&](std::int64_t body) {
      const double* from = scene.bodies[static_cast<std::size_t>(body)].position;
      const double r[] = {given.point[0] - from[0], given.point[1] - from[1], given.point[2] - from[2]};
      return rounded<Real>(r);
    };
    if (given.a >= 0) contact.arm_a = arm(given.a);
    contact.arm_b = arm(given.b);
  }
  return env;
}

/// A reaction on the tangents of contact_tangents(), on those of the file.
template <class Real>
std::array<double, 3> on_given_axes(const engines::Contact& contact, const Real* impulse) {
  const double normal[3] = {contact.normal[0], contact.normal[1], contact.normal[2]};
  double first[3], second[3];
  contact_tangents(normal, first, second);
  std::array<double, 3> all = {static_cast<double>(impulse[0]), 0, 0};
  for (std::size_t i = 0; i < 3; ++i) {
    const double friction = static_cast<double>(impulse[1]) * first[i] + static_cast<double>(impulse[2]) * second[i];
    all[1] += friction * contact.t1[i];
    all[2] += friction * contact.t2[i];
  }
  return all;
}

template <class Real>
int solve(const std::vector<engines::Scene>& scenes, bool momentum, char** words) {
  BodyBatch<Real> batch;
  for (const engines::Scene& scene : scenes) batch.add(environment<Real>(scene));
  const BodyBatchView<Real> view = batch.view();
  BodySolverOptions options;
  options.iterations = engines::number<Index>(words[2]);
  options.momentum = momentum;
  options.threads = 1;
  const BodySolver solver(Device::cpu(), {}, options);
  const BodyPlan plan = solver.plan(view);
  std::vector<Real> impulse(static_cast<std::size_t>(3 * view.contact_count));
  std::vector<Real> twist(static_cast<std::size_t>(6 * view.body_count));
  std::vector<EnvStatus> status(static_cast<std::size_t>(view.env_count));
  const engines::Call call = engines::timed(batch, engines::number<double>(words[3]), [&](const auto&) {
    engines::Call once;
    const engines::Stopwatch solving;
    solver.solve(plan, view, {impulse.data(), twist.data(), nullptr, status.data()});
    once.solve = solving.seconds() / static_cast<double>(scenes.size());
    return once;
  });
  std::FILE* out = std::fopen(words[5], "wb");
  if (out == nullptr) engines::fail("the output cannot be opened");
  const Real* own = impulse.data();
  for (const engines::Scene& scene : scenes) {
    const std::int64_t how = 0;
    std::vector<double> numbers = {call.solve, 0};
    for (const engines::Contact& contact : scene.contacts) {
      for (const double value : on_given_axes(contact, own)) numbers.push_back(value);
      own += 3;
    }
    if (std::fwrite(&how, sizeof how, 1, out) != 1 ||
        std::fwrite(numbers.data(), sizeof(double), numbers.size(), out) != numbers.size())
      engines::fail("the output cannot be written");
  }
  return std::fclose(out) == 0 ? 0 : 2;
}

}  // namespace

int run(int argc, char** argv) {
  if (argc != 6) engines::fail("usage: bench_body_file SOLVER ITERATIONS SECONDS IN OUT");
  const std::string name = argv[1];
  const bool momentum = name.rfind("momentum_", 0) == 0;
  std::FILE* in = std::fopen(argv[4], "rb");
  if (in == nullptr) engines::fail("the input cannot be opened");
  std::vector<engines::Scene> scenes(static_cast<std::size_t>(engines::take<std::int64_t>(in, 1)[0]));
  for (engines::Scene& scene : scenes) engines::read(in, scene);
  std::fclose(in);
  if (name == "si_f32" || name == "momentum_f32") return solve<float>(scenes, momentum, argv);
  if (name == "si_f64" || name == "momentum_f64") return solve<double>(scenes, momentum, argv);
  engines::fail("no such solver");
}

}  // namespace stiction::bench
