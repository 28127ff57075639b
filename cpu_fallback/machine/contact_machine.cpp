#include <algorithm>
#include <cstring>
#include <functional>
#include <memory>
#include <new>
#include <string>

#include "core/algorithm/driver/solver_selection.hpp"
#include "core/algorithm/problem/slice.hpp"
#include "core/base/fp_env.hpp"
#include "core/machine/contact_machine.hpp"
#include "cpu_fallback/pack/work_items.hpp"
#include "cpu_fallback/tables/isa.hpp"
#include "cpu_fallback/tables/scratch.hpp"
#include "cpu_fallback/threads/thread_pool.hpp"
#include "stiction/trace.hpp"

namespace stiction {

namespace {

const char* name_of(EnvPath path) {
  switch (path) {
    case EnvPath::empty:
      return "empty";
    case EnvPath::dense:
      return "dense";
    case EnvPath::sparse:
      return "sparse";
    case EnvPath::factor:
      return "factor";
  }
  return "?";
}

class CpuContactMachine final : public ContactMachine {
 public:
  void solve(const SolveRequest<float>& request) override { run(request); }
  void solve(const SolveRequest<double>& request) override { run(request); }
  void parallel_for(int threads, Offset count, const std::function<void(Offset, Offset)>& work) override {
    cpu::parallel_for(cpu::thread_count(threads), count, work);
  }
  void* allocate(std::size_t bytes) override { return ::operator new(bytes, std::align_val_t{64}); }
  void release(void* memory) noexcept override { ::operator delete(memory, std::align_val_t{64}); }
  void copy_to_host(void* target, const void* source, std::size_t bytes, StreamRef) override {
    std::memcpy(target, source, bytes);
  }

 private:
  template <class Real>
  void run(const SolveRequest<Real>& request) {
    // The options are rounded to Real below: that too must not see the caller's rounding mode.
    const ScopedFpEnv fp_env;
    const SolverOptions& options = request.options;
    const PlanData& plan = *request.plan;
    cpu::Job<Real> job{{request.batch,
                        {plan.path.data(), plan.counts.data(), plan.cone_order.data(), plan.env_vertex_offsets.data(),
                         plan.vertex_offsets.data(), plan.env_color_offsets.data(), plan.color_offsets.data(),
                         plan.color_count.data()},
                        request.warm_start,
                        request.solution.lambda,
                        request.solution.w,
                        request.solution.status,
                        options.tolerance,
                        options.max_iterations,
                        options.stall_window,
                        static_cast<Real>(options.omega),
                        request.law,
                        -1,
                        options.absolute_tolerance},
                       request.full_rows == nullptr ? nullptr : request.full_rows->data()};
    if (options.solver == SolverKind::automatic) {
      run_fallbacks(request, job);
    } else {
      job.direct_rows = options.direct_rows;
      solve_by(request, job, options.solver, [](Offset) { return true; });
    }
  }

  /// Solves the environments for which `takes` is true.
  template <class Real>
  void solve_by(const SolveRequest<Real>& request, const cpu::Job<Real>& job, SolverKind solver,
                const std::function<bool(Offset)>& takes) const {
    const SolverOptions& options = request.options;
    const PlanData& plan = *request.plan;
    const cpu::KernelSet set = isa_.kernels(solver);
    const cpu::SingleKernels<Real>& single = cpu::of_precision<Real>(set.single);
    const cpu::PackKernels<Real>& packs = set.packs.of<Real>(request.law);
    const int threads = cpu::thread_count(options.threads);
    const auto matrix_bytes = [&](const ConeCounts& slots) {
      const Offset rows = row_count(slots);
      return rows * rows * packs.width * static_cast<Offset>(sizeof(Real));
    };
    const auto items = cpu::make_work_items(plan, takes, {threads, packs.width, matrix_bytes});
    std::vector<cpu::Scratch> scratch(static_cast<std::size_t>(threads));
    cpu::parallel_for(threads, static_cast<int>(items.size()), [&](int index, int worker) {
      const cpu::WorkItem<ConeCounts>& item = items[static_cast<std::size_t>(index)];
      const ScopedSpan span(options.tracer, item.packed ? "pack" : "one by one",
                            name_of(plan.path[static_cast<std::size_t>(item.envs.front())]), worker,
                            static_cast<std::int64_t>(item.envs.size()));
      cpu::Scratch& memory = scratch[static_cast<std::size_t>(worker)];
      if (item.packed) {
        packs.solve(job, item.envs.data(), static_cast<Offset>(item.envs.size()), item.shape,
                    memory.reserve<Real>(packs.elements(item.shape)));
      } else {
        for (const Offset env : item.envs) single.solve(job, env, memory.reserve<Real>(single.elements(job, env)));
      }
    });
  }

  /// Runs the fallback chain (docs/math/auto.md): each stage restarts its environments from the current answer.
  template <class Real>
  void run_fallbacks(const SolveRequest<Real>& request, cpu::Job<Real> job) const {
    const Offset envs = request.batch.env_count;
    const int threads = cpu::thread_count(request.options.threads);
    std::vector<EnvFeatures> seen(static_cast<std::size_t>(envs));
    std::vector<int> assigned(static_cast<std::size_t>(envs));
    constexpr Offset kEnvsPerChoice = 64;
    cpu::parallel_for(threads, static_cast<int>((envs + kEnvsPerChoice - 1) / kEnvsPerChoice), [&](int run, int) {
      SerialTeam team;
      for (Offset env = run * kEnvsPerChoice; env < envs && env < (run + 1) * kEnvsPerChoice; ++env) {
        const auto e = static_cast<std::size_t>(env);
        EnvView<Real> view = slice(job, env);
        view.is_full = job.full_rows != nullptr && job.full_rows[env] == FullRows::known;
        begin_fallbacks(team, view);
        seen[e] = features(team, view);
        assigned[e] = first_turn(seen[e]);
      }
    });
    job.warm_start = job.lambda;
    const Real omega = job.omega;
    for (int turn = 0; turn < kFallbackTurns; ++turn) {
      if (std::find(assigned.begin(), assigned.end(), turn) == assigned.end()) continue;
      const FallbackTurn own = fallback_turn(turn);
      job.stage = own.stage;
      job.omega = omega * static_cast<Real>(own.omega);
      solve_by(request, job, own.solver, [&](Offset env) { return assigned[static_cast<std::size_t>(env)] == turn; });
      for (std::size_t env = 0; env < assigned.size(); ++env)
        if (assigned[env] == turn && falls_short(job.status[env])) assigned[env] = next_turn(turn, seen[env]);
    }
  }

  const cpu::Isa& isa_ = cpu::best_isa();
};

}  // namespace

std::unique_ptr<ContactMachine> make_cpu_contact_machine() {
  return std::make_unique<CpuContactMachine>();
}

DeviceReport cpu_report() {
  return {Device::cpu(), true,
          std::string("CPU, ") + cpu::best_isa().name + ", " + std::to_string(cpu::thread_count(0)) + " cores", ""};
}

}  // namespace stiction
