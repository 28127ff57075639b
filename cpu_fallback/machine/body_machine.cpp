#include <cstring>
#include <functional>
#include <memory>
#include <new>
#include <vector>

#include "core/base/fp_env.hpp"
#include "core/machine/body_machine.hpp"
#include "cpu_fallback/pack/work_items.hpp"
#include "cpu_fallback/tables/isa.hpp"
#include "cpu_fallback/tables/scratch.hpp"
#include "cpu_fallback/threads/thread_pool.hpp"
#include "cpu_fallback/threads/thread_team.hpp"

namespace stiction {

namespace {

/// Scratch of one worker: two pieces at a time.
struct Scratch {
  cpu::GrowBuffer numbers;
  cpu::GrowBuffer exact;
};

template <class Real>
void run(const BodyRequest<Real>& request) {
  const BodyPlanData& plan = *request.plan;
  const cpu::BodyKernelSet set = cpu::best_isa().body_kernels();
  const cpu::BodySingleKernels<Real>& kernels = set.single.of<Real>(contact_law(request.options));
  const cpu::BodyPackKernels<Real>& packs = set.packs.of<Real>(contact_law(request.options));
  const BodyJob<Real> job{request.batch,      plan.view(),      request.solution,
                          request.warm_start, request.stepping, request.options};
  const int threads = cpu::thread_count(request.options.threads);
  const auto bodies = [&](Offset env) { return job.batch.env_body_offsets[env + 1] - job.batch.env_body_offsets[env]; };
  const auto numbers = [&](Offset env, Scratch& scratch) {
    return scratch.numbers.reserve<Real>(
        kernels.elements(plan.kept[static_cast<std::size_t>(env)], bodies(env), request.options.momentum));
  };
  const cpu::NewtonBodyKernelSet newton_set = cpu::best_isa().newton_body_kernels();
  const cpu::NewtonBodyKernels<Real>& newton = newton_set.of<Real>(request.options.law);
  const bool is_newton = request.options.method == BodyMethod::newton;
  const auto exact = [&](Offset env, Scratch& scratch) {
    return scratch.exact.reserve<double>(kernels.exact_elements(bodies(env)) +
                                         (is_newton ? newton.doubles(job, env) : 0));
  };
  const auto solve_alone = is_newton ? newton.solve_alone : kernels.solve_alone;
  const auto solve_together = is_newton ? newton.solve_together : kernels.solve_together;
  const auto pack_exact = [&](const cpu::PackShape& shape) {
    return packs.exact_elements(shape, request.options.momentum);
  };
  const auto pack_bytes = [&](const cpu::PackShape& shape) {
    return packs.elements(shape, request.options.momentum) * static_cast<Offset>(sizeof(Real)) +
           pack_exact(shape) * static_cast<Offset>(sizeof(double));
  };
  const cpu::BodyWorkItems work = cpu::make_work_items(plan, job.batch.env_body_offsets, job.batch.env_contact_offsets,
                                                       {threads, is_newton ? 1 : packs.width, pack_bytes});
  for (const Offset env : work.large) {
    Scratch scratch;
    Real* const memory = numbers(env, scratch);
    double* const twists = exact(env, scratch);
    cpu::run_team(threads,
                  [&](cpu::ThreadTeam& team, Index rank) { solve_together(job, env, memory, twists, team, rank); });
  }
  std::vector<Scratch> scratch(static_cast<std::size_t>(threads));
  cpu::parallel_for(threads, static_cast<int>(work.items.size()), [&](int index, int worker) {
    Scratch& own = scratch[static_cast<std::size_t>(worker)];
    const cpu::WorkItem<cpu::PackShape>& item = work.items[static_cast<std::size_t>(index)];
    if (item.packed) {
      Real* const memory = own.numbers.reserve<Real>(packs.elements(item.shape, request.options.momentum));
      packs.solve(job, item.envs.data(), static_cast<Offset>(item.envs.size()), item.shape, memory,
                  own.exact.reserve<double>(pack_exact(item.shape)));
    } else {
      for (const Offset env : item.envs) solve_alone(job, env, numbers(env, own), exact(env, own));
    }
  });
}

class CpuBodyMachine final : public BodyMachine {
 public:
  void solve(const BodyRequest<float>& request) override { run(request); }
  void solve(const BodyRequest<double>& request) override { run(request); }
  void parallel_for(int threads, Offset count, const std::function<void(Offset, Offset)>& work) override {
    cpu::parallel_for(cpu::thread_count(threads), count, work);
  }
  void copy_to_host(void* target, const void* source, std::size_t bytes, StreamRef) override {
    std::memcpy(target, source, bytes);
  }
};

}  // namespace

std::unique_ptr<BodyMachine> make_cpu_body_machine() {
  return std::make_unique<CpuBodyMachine>();
}

template <class Real>
Offset contact_bytes(Law law, bool momentum) {
  const cpu::BodyKernelSet set = cpu::best_isa().body_kernels();
  // Sides and the vertex's first position are integers of the plan.
  return set.single.of<Real>(law).swept_elements(momentum) * static_cast<Offset>(sizeof(Real)) +
         3 * static_cast<Offset>(sizeof(Index));
}

template Offset contact_bytes<float>(Law, bool);
template Offset contact_bytes<double>(Law, bool);

}  // namespace stiction
