#pragma once

#include <algorithm>
#include <vector>

#include "core/algorithm/rigid/lane_bodies.hpp"
#include "core/algorithm/rigid/pack_sweep.hpp"
#include "core/base/extents.hpp"
#include "cpu_fallback/pack/body_lane.hpp"
#include "cpu_fallback/pack/pack_driver.hpp"
#include "cpu_fallback/pack/pack_width.hpp"
#include "cpu_fallback/tables/body_kernels.hpp"

/// Environments of rigid bodies in the lanes of a pack. Compiled once per instruction set.
namespace stiction::inline STICTION_ISA {

/// The memory of a pack for environments of at most `shape`, cut into its arrays. All of it lies in numbers of Real,
/// but the twists in double.
template <Law kLaw, class Real>
struct BodyPackMemory {
  static constexpr int kWidth = kPackWidth<Real>;
  using Lanes = BodyPack<Real, kWidth, kLaw>;
  using Sides = PackSides<Real, kWidth>;
  using Word = typename Sides::Word;

  static Offset numbers(const cpu::PackShape& shape, bool momentum) {
    return Lanes::elements(shape.contacts, shape.bodies, momentum) * kWidth;
  }
  static Offset words(const cpu::PackShape& shape) { return 2 * Offset{shape.contacts} * kWidth; }
  /// With the flags of sides, one byte each, at the end. Whole vectors, so that another pack may follow.
  static Offset elements(const cpu::PackShape& shape, bool momentum) {
    const Offset flags = 2 * Offset{shape.contacts};
    return numbers(shape, momentum) + words(shape) + (flags + kWidth - 1) / kWidth * kWidth;
  }
  /// Numbers of double: twists, and as many for sums.
  static Offset exact_elements(const cpu::PackShape& shape) { return 2 * twists(shape); }
  static Offset twists(const cpu::PackShape& shape) {
    return kWidth * BodySystem<Real, kLaw>::exact_elements(shape.bodies);
  }
  static Sides sides(const cpu::PackShape& shape, bool momentum, Real* memory) {
    static_assert(sizeof(Word) == sizeof(Real));
    Real* const words_begin = memory + numbers(shape, momentum);
    return {reinterpret_cast<Word*>(words_begin), reinterpret_cast<std::uint8_t*>(words_begin + words(shape))};
  }
};

/// A pack of environments of rigid bodies.
template <Law kLaw, class Real>
class BodyPackRun : public PackDriver<BodyPackRun<kLaw, Real>, kPackWidth<Real>> {
  using Driver = PackDriver<BodyPackRun, kPackWidth<Real>>;
  friend Driver;
  using Driver::busy_;
  using Driver::queue_;
  using Memory = BodyPackMemory<kLaw, Real>;
  using Lanes = typename Memory::Lanes;
  using Packed = typename Lanes::Real;
  using Lane = BodyLane<Real>;

 public:
  using Driver::kWidth;
  static constexpr bool kTakesPairs = true;

  BodyPackRun(const BodyJob<Real>& job, EnvQueue& queue, const cpu::PackShape& shape, Real* memory, double* exact)
      : Driver(queue),
        job_(job),
        params_(si_params(job.stepping, job.options)),
        shape_(shape),
        memory_(memory),
        exact_{exact, exact + Memory::twists(shape)},
        pack_(shape.contacts, shape.bodies, params_, memory),
        env_{Memory::sides(shape, params_.momentum, memory)} {
    // Idle lanes compute on whatever they hold; they must hold numbers only so that no slow path is taken.
    std::fill_n(memory, Memory::numbers(shape, params_.momentum), Real(0));
    std::fill_n(exact, Memory::exact_elements(shape), 0.0);
    if (job.options.blocks == BlockMode::cones) return;
    block_ends_.resize(at(shape.contacts));
    longest_block_.resize(at(shape.contacts));
    env_.blocks = {block_ends_.data(), longest_block_.data()};
  }

  /// Sweeps until the first chunk ends, and the work behind a chunk in the lanes where one has ended.
  void advance() {
    measure();
    compose();
    const Index count = sweeps_to_go();
    SiMomentum<Packed> momentum = momentum_of_lanes();
    run_sweeps(team_, env_, pack_, params_, count, momentum);
    end_chunks(count, momentum);
  }
  /// Advances two packs, which alternate.
  static void advance(BodyPackRun& a, BodyPackRun& b) {
    for (BodyPackRun* run : {&a, &b}) {
      run->measure();
      run->compose();
    }
    const Index count = smaller_of(a.sweeps_to_go(), b.sweeps_to_go());
    NumberPair<SiMomentum<Packed>> momentum{a.momentum_of_lanes(), b.momentum_of_lanes()};
    run_sweeps(a.team_, EnvPair<PackEnv<Real, kWidth>>{a.env_, b.env_}, SystemPair<const Lanes>{a.pack_, b.pack_},
               a.params_, count, momentum);
    a.end_chunks(count, momentum.a);
    b.end_chunks(count, momentum.b);
  }

 private:
  static constexpr int kTogether = 1;

  /// The system in a lane, as the body of a single environment knows it.
  typename Lanes::OneLane system_of(int l) const {
    typename Lanes::OneLane system(shape_.contacts, shape_.bodies, params_, memory_ + l, exact_.twists + l);
    system.contacts = lanes_[l].env.kept;
    system.bodies = lanes_[l].env.bodies;
    return system;
  }

  [[nodiscard]] LaneSet due() const {
    return lanes_that([](const Lane& lane) { return lane.left == 0; });
  }

  /// In those lanes, all of them busy, a chunk has ended: finalize_bodies() releases the lane, or it begins another.
  void check_convergence(LaneSet due) {
    AskedLanes<Real, kWidth> asked;
    SiPoll polls[kWidth];
    due.for_each([&](int l) {
      Lane& lane = lanes_[l];
      const auto system = system_of(l);
      if (!reach_last_substep(team_, lane.env, system, params_, lane.progress)) return;
      polls[l] = poll_last_substep(team_, system, params_, lane.progress);
      if (!polls[l].is_asked) return;
      set_exact(l);
      asked.add(l, lane.env);
    });
    FinalResidual evaluated[kWidth];
    const ErrorScale* scales[kWidth];
    for (int l = 0; l < kWidth; ++l) scales[l] = &lanes_[l].progress.scale;
    evaluate_body_lanes(env_, pack_, params_, exact_, asked, scales, evaluated);
    due.for_each([&](int l) {
      Lane& lane = lanes_[l];
      const auto system = system_of(l);
      if (asked.env[l] != nullptr) {
        const Verdict verdict = judge<Real>(evaluated[l], lane.progress.scale.largest, allowance(params_));
        if (finalize_bodies(team_, lane.env, system, params_, polls[l], verdict, lane.progress)) {
          busy_.remove(l);
          return;
        }
      }
      lane.left = next_chunk(params_, lane.progress);
      if (lane.progress.step != lane.substep) load_lane_free(pack_, lane.env, system, params_, l);
      lane.substep = lane.progress.step;
    });
  }

  /// Takes environments into all free lanes, and their first residuals, which may be all that they need. Returns the
  /// lanes of those that can be solved.
  LaneSet load_free_lanes() {
    LaneSet entered;
    for (int l = 0; l < kWidth; ++l)
      while (!busy_.has(l) && !queue_.is_empty())
        if (load_lane(l, queue_.take())) entered.add(l);
    if (entered.is_empty()) return entered;
    const LaneSet loaded = load_new(entered);
    // All lanes together take as long as some one by one.
    evaluate_new(loaded, 4 * entered.count() > kWidth);
    return loaded;
  }

  /// Takes an environment's numbers into a lane. Returns true if they can be used.
  bool load_lane(int l, Offset env) {
    Lane& lane = lanes_[l];
    lane.env = slice_bodies(job_, env);
    if (!admit_bodies(team_, lane.env, params_, lane.progress)) return false;
    busy_.add(l);
    take_lane(pack_, lane.env, system_of(l), is_warm(lane.env, lane.progress.flags), l);
    rest_from(pack_, lane.env.kept, lane.env.bodies, shape_.contacts, shape_.bodies, l);
    is_composed_ = false;
    return true;
  }

  /// A lane's free twists, in double.
  void set_exact(int l) {
    const Lane& lane = lanes_[l];
    const auto system = system_of(l);
    for (Index body = 0; body <= lane.env.bodies; ++body)
      put_twist(system.exact_row(body), free_twist(lane.env, system, params_, body));
  }

  /// Computes the dependents of the numbers that have entered. An environment that cannot be solved is answered.
  LaneSet load_new(LaneSet entered) {
    measure();
    compose();
    Packed kept(0), entering(0), warm(0);
    busy_.for_each([&](int l) { kept.v[l] = static_cast<Real>(lanes_[l].env.kept); });
    entered.for_each([&](int l) {
      const Lane& lane = lanes_[l];
      entering.v[l] = kept.v[l];
      if (is_warm(lane.env, lane.progress.flags)) warm.v[l] = Real(1);
      set_exact(l);
      load_lane_free(pack_, lane.env, system_of(l), params_, l);
    });
    const auto bad = load_contacts(env_, pack_, params_, kept, warm > Packed(0));
    ErrorScale scales[kWidth];
    begin_lanes(env_, pack_, params_, exact_, entering, scales);
    LaneSet loaded;
    entered.for_each([&](int l) {
      Lane& lane = lanes_[l];
      const std::uint32_t flags = is_set(bad, l) ? kFlagBadDiagonal : 0U;
      if (!is_sound(team_, lane.env, params_, flags, lane.progress)) {
        busy_.remove(l);
        is_composed_ = false;
        return;
      }
      set_out(lane.progress, scales[l]);
      const Strided<double, kWidth> reach{exact_.sums + l};
      weigh_islands(team_, lane.env, system_of(l), reach, scales[l].largest > 1e-300 ? scales[l].largest : 0.0);
      loaded.add(l);
    });
    return loaded;
  }

  /// The first residuals of environments that have entered.
  void evaluate_new(LaneSet loaded, bool is_together) {
    if (is_together) {
      const auto due = mask_of<Real, kWidth>(loaded);
      refresh_lanes(env_, pack_, due);
      if (params_.momentum) start_momentum_in(pack_, due);
      keep_estimates(loaded);
    }
    loaded.for_each([&](int l) {
      Lane& lane = lanes_[l];
      if (!is_together) evaluate_first(team_, lane.env, system_of(l), params_, lane.progress);
      lane.substep = 0;
    });
  }

  /// Measures the part of the pack in use.
  void measure() {
    pack_.contacts = pack_.bodies = 0;
    busy_.for_each([&](int l) {
      const Lane& lane = lanes_[l];
      pack_.contacts = larger_of(pack_.contacts, lane.env.kept);
      pack_.bodies = larger_of(pack_.bodies, lane.env.bodies);
    });
  }

  /// Updates the pack's data of all lanes together.
  void compose() {
    if (is_composed_) return;
    write_sides(env_.sides, lanes_, busy_, pack_.contacts);
    if (!block_ends_.empty()) write_blocks<Real, kWidth>(block_ends_, longest_block_, lanes_, busy_);
    for (Offset side_index = 0; side_index < 2 * Offset{pack_.contacts}; ++side_index)
      if (const auto slots = slot_of(env_.side(side_index)); !slots.is_uniform) pack_.keep_masses(slots);
    is_composed_ = true;
  }

  /// The busy lanes of which f(lane) is true.
  template <class F>
  LaneSet lanes_that(F&& f) const {
    LaneSet chosen;
    busy_.for_each([&](int l) {
      if (f(lanes_[l])) chosen.add(l);
    });
    return chosen;
  }

  void keep_estimates(LaneSet due) {
    const Packed estimate = estimate_residual(team_, env_, pack_);
    due.for_each([&](int l) { lanes_[l].progress.estimate = estimate.v[l]; });
  }

  /// Sweeps until the first chunk ends.
  [[nodiscard]] Index sweeps_to_go() const {
    Index count = kSiChunk;
    busy_.for_each([&](int l) { count = smaller_of(count, lanes_[l].left); });
    return count;
  }

  [[nodiscard]] SiMomentum<Packed> momentum_of_lanes() const {
    SiMomentum<Packed> momentum;
    busy_.for_each([&](int l) {
      momentum.theta.v[l] = lanes_[l].progress.momentum.theta;
      momentum.progress.v[l] = lanes_[l].progress.momentum.progress;
    });
    return momentum;
  }

  /// After so many sweeps: the work behind a chunk in the lanes where one has ended. One of two packs that alternate
  /// may have no such lane.
  void end_chunks(Index count, const SiMomentum<Packed>& momentum) {
    busy_.for_each([&](int l) {
      Lane& lane = lanes_[l];
      lane.progress.momentum = {momentum.theta.v[l], momentum.progress.v[l]};
      lane.left -= count;
      if (lane.left == 0) lane.progress.done += next_chunk(params_, lane.progress);
    });
    const LaneSet ended = due();
    if (ended.is_empty()) return;
    refresh_lanes(env_, pack_, mask_of<Real, kWidth>(ended));
    keep_estimates(ended);
  }

  const BodyJob<Real>& job_;
  SiParams params_;
  cpu::PackShape shape_;
  Real* memory_;
  ExactWorkspace exact_;
  SerialTeam team_;
  Lanes pack_;
  PackEnv<Real, kWidth> env_;
  std::vector<typename PackBlocks<Real, kWidth>::Lanes> block_ends_;  ///< empty without blocks     (shape.contacts)
  std::vector<Index> longest_block_;                                  ///< of all lanes             (shape.contacts)
  Lane lanes_[kWidth];
  bool is_composed_ = false;  ///< none has entered since compose()
};

/// Returns true if environments of this room go through two packs that alternate: as long as the second-level cache
/// holds both. Only speed depends on it.
template <Law kLaw, class Real>
bool takes_body_pairs(const cpu::PackShape& shape, bool momentum) {
  constexpr Offset kMostBytes = Offset{320} << 10;
  return BodyPackMemory<kLaw, Real>::elements(shape, momentum) * static_cast<Offset>(sizeof(Real)) <= kMostBytes;
}

/// Packs that are worked on at once.
template <Law kLaw, class Real>
int body_packs(const cpu::PackShape& shape, bool momentum) {
  return takes_body_pairs<kLaw, Real>(shape, momentum) ? 2 : 1;
}
template <Law kLaw, class Real>
Offset body_pack_elements(const cpu::PackShape& shape, bool momentum) {
  return body_packs<kLaw, Real>(shape, momentum) * BodyPackMemory<kLaw, Real>::elements(shape, momentum);
}
template <Law kLaw, class Real>
Offset body_pack_exact_elements(const cpu::PackShape& shape, bool momentum) {
  return body_packs<kLaw, Real>(shape, momentum) * BodyPackMemory<kLaw, Real>::exact_elements(shape);
}

template <Law kLaw, class Real>
void solve_body_pack(const BodyJob<Real>& job, const Offset* envs, Offset count, const cpu::PackShape& shape,
                     Real* memory, double* exact) {
  using Run = BodyPackRun<kLaw, Real>;
  using Memory = BodyPackMemory<kLaw, Real>;
  const bool momentum = job.options.momentum;
  EnvQueue queue{envs, count};
  run_packs<Run>(queue, takes_body_pairs<kLaw, Real>(shape, momentum), [&](int k) {
    return Run(job, queue, shape, memory + k * Memory::elements(shape, momentum),
               exact + k * Memory::exact_elements(shape));
  });
}

}  // namespace stiction::inline STICTION_ISA
