#include "core/machine/articulated_machine.hpp"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <numeric>
#include <vector>

#include "core/algorithm/articulated/reset.hpp"
#include "core/base/extents.hpp"
#include "cpu_fallback/tables/isa.hpp"
#include "cpu_fallback/tables/kernel_tables.hpp"
#include "cpu_fallback/threads/thread_pool.hpp"

namespace stiction {

namespace {

/// Steps after which robots are put into packs anew, by the rows that they have now.
constexpr Index kStepsOfAnOrder = 4;

/// Robots that are ordered together, and how many of them a pack looks among for its next one.
constexpr Offset kChunk = 256, kWindow = 32;

/// Robots that have rows alike, side by side: a pack computes the rows that any of its robots has. No bit depends on
/// it.
class LikeRobots {
 public:
  [[nodiscard]] const Offset* envs() const { return envs_.data(); }

  /// Orders robots for packs of `width`: those with most rows first, then each pack takes what adds fewest classes of
  /// rows to it. Robots that do not step come last.
  void sort(const std::uint64_t* touched, const std::uint8_t* active, Offset count, Index width, int threads) {
    envs_.resize(at(count));
    std::iota(envs_.begin(), envs_.end(), Offset{0});
    if (touched == nullptr || width == 1) return;
    const auto rank = [&](Offset env) {
      return active != nullptr && active[env] == 0 ? -1 : std::popcount(touched[env]);
    };
    std::stable_sort(envs_.begin(), envs_.end(), [&](Offset a, Offset b) { return rank(a) > rank(b); });
    const auto chunks = static_cast<int>((count + kChunk - 1) / kChunk);
    cpu::parallel_for(threads, chunks, [&](int chunk, int) {
      const Offset first = chunk * kChunk;
      make_packs(touched, envs_.data() + first, smaller_of(kChunk, count - first), width);
    });
  }

 private:
  static void make_packs(const std::uint64_t* touched, Offset* envs, Offset count, Index width) {
    for (Offset begin = 0; begin < count; begin += width) {
      std::uint64_t pack = touched[envs[begin]];
      const Offset end = smaller_of(count, begin + width);
      for (Offset seat = begin + 1; seat < end; ++seat) {
        const Offset best = best_of(touched, envs, seat, smaller_of(count, seat + kWindow), pack);
        pack |= touched[envs[best]];
        std::rotate(envs + seat, envs + best, envs + best + 1);  // others keep their order
      }
    }
  }
  /// The first place of those from `seat` on whose robot adds fewest classes to a pack.
  static Offset best_of(const std::uint64_t* touched, const Offset* envs, Offset seat, Offset end, std::uint64_t pack) {
    Offset best = seat;
    int least = 65;
    for (Offset place = seat; place < end && least > 0; ++place) {
      const int added = std::popcount(touched[envs[place]] & ~pack);
      if (added < least) best = place;
      least = added < least ? added : least;
    }
    return best;
  }

  std::vector<Offset> envs_;
};

/// Robots of a pack make all steps of an order before the next pack begins: their numbers stay in a core's cache.
template <class Real>
class CpuArticulatedMachine final : public ArticulatedMachine<Real> {
 public:
  explicit CpuArticulatedMachine(int threads)
      : threads_(cpu::thread_count(threads)),
        kernels_(cpu::of_precision<Real>(cpu::best_isa().articulated())),
        scratch_(at(threads_)) {}

  void step(const ArticulatedJob<Real>& job, Offset env_count, Index count, StreamRef) override {
    const bool is_whole = job.active == nullptr;
    if (steps_left_ <= 0 || !is_whole || !was_whole_) steps_left_ = 0;
    was_whole_ = is_whole;
    while (count > 0) {
      if (steps_left_ == 0) {
        like_.sort(job.touched, job.active, env_count, kernels_.width, threads_);
        steps_left_ = kStepsOfAnOrder;
      }
      const Index now = smaller_of(count, steps_left_);
      ArticulatedJob<Real> part = job;
      if (now < count) part.observed = nullptr;  // the last step of a call is observed
      step_packs(part, env_count, now);
      count -= now;
      steps_left_ = job.touched == nullptr ? 0 : steps_left_ - now;
    }
  }
  void reset(const ArticulatedResetJob<Real>& job, StreamRef) override {
    SerialTeam team;
    for (Offset env = 0; env < job.env_count; ++env) reset_masked(team, job, env);
  }
  void overwrite(void* array, const void* from, std::size_t bytes, StreamRef) override {
    std::memcpy(array, from, bytes);
  }

 private:
  void step_packs(const ArticulatedJob<Real>& job, Offset env_count, Index count) {
    const Offset width = kernels_.width;
    const auto packs = static_cast<int>((env_count + width - 1) / width);
    cpu::parallel_for(threads_, packs, [&](int pack, int worker) {
      const Offset first = pack * width;
      const auto envs = static_cast<Index>(smaller_of(width, env_count - first));
      kernels_.step(job, like_.envs() + first, envs, count, scratch_[at(worker)]);
    });
  }

  int threads_;
  cpu::ArticulatedKernels<Real> kernels_;
  std::vector<cpu::ArticulatedScratch> scratch_;  ///< of each worker
  LikeRobots like_;
  Index steps_left_ = 0;  ///< until robots are ordered anew
  bool was_whole_ = true;
};

}  // namespace

template <class Real>
std::unique_ptr<ArticulatedMachine<Real>> make_cpu_articulated_machine(int threads) {
  return std::make_unique<CpuArticulatedMachine<Real>>(threads);
}

template std::unique_ptr<ArticulatedMachine<float>> make_cpu_articulated_machine(int);
template std::unique_ptr<ArticulatedMachine<double>> make_cpu_articulated_machine(int);

}  // namespace stiction
