#pragma once

#include <algorithm>

#include "core/algorithm/rigid/lane_bodies.hpp"
#include "core/algorithm/rigid/pack_sweep.hpp"
#include "core/base/extents.hpp"
#include "cpu_fallback/kernels/body_kernels.hpp"
#include "cpu_fallback/pack/env_queue.hpp"
#include "cpu_fallback/pack/pack_width.hpp"

/// Feeds body environments through the lanes of a pack. Compiled once per instruction set.
namespace stiction::inline STICTION_ISA {

/// The memory of a pack for environments of at most `shape`, cut into what it keeps. All of it lies in numbers of Real,
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

/// What a lane works on.
template <class Real>
struct BodyLane {
  BodyEnv<Real> env;
  SiProgress<Real> progress;
  Index left = 0;     ///< sweeps until its chunk ends
  Index substep = 0;  ///< the one that the pack has the free twists of
  bool busy = false;
  bool is_new = false;  ///< not looked at yet
};

/// The sides of all lanes, once more after some lanes have another environment.
template <class Real, int W>
void write_sides(const PackSides<Real, W>& sides, const BodyLane<Real> (&lanes)[W], Index contacts) {
  for (Offset side_index = 0; side_index < 2 * Offset{contacts}; ++side_index) {
    Index slot = -1;
    bool uniform = true;
    for (const BodyLane<Real>& lane : lanes) {
      if (!lane.busy || side_index >= 2 * Offset{lane.env.kept}) continue;
      const Index own = slot_of(lane.env.side(side_index));
      if (slot < 0) slot = own;
      uniform = uniform && own == slot;
    }
    sides.is_uniform[side_index] = uniform ? 1 : 0;
    for (int l = 0; l < W; ++l)
      sides.side[side_index * W + l] =
          lanes[l].busy && side_index < 2 * Offset{lanes[l].env.kept} ? lanes[l].env.side(side_index) : ~slot;
  }
}

/// Like solve_pack(), lets environments enter and leave lanes between chunks, each with its own count of sweeps. So
/// what one computes does not depend on its lane, its neighbours or the moment it entered.
template <Law kLaw, class Real>
class BodyPackRun {
  using Memory = BodyPackMemory<kLaw, Real>;
  using Lanes = typename Memory::Lanes;
  using Packed = typename Lanes::Real;
  using Lane = BodyLane<Real>;
  static constexpr int kWidth = Memory::kWidth;

 public:
  BodyPackRun(const BodyJob<Real>& job, EnvQueue& queue, const cpu::PackShape& shape, Real* memory, double* exact)
      : job_(job),
        queue_(queue),
        params_(si_params(job.stepping, job.options)),
        shape_(shape),
        memory_(memory),
        exact_{exact, exact + Memory::twists(shape)},
        pack_(shape.contacts, shape.bodies, params_, memory),
        env_{Memory::sides(shape, params_.momentum, memory)} {
    // Idle lanes compute on whatever they hold; they must hold numbers only so that no slow path is taken.
    std::fill_n(memory, Memory::numbers(shape, params_.momentum), Real(0));
    std::fill_n(exact, Memory::exact_elements(shape), 0.0);
  }

  /// Answers finished environments and loads others. Whether there is anything to advance.
  bool refill() {
    check_convergence([](const Lane& lane) { return lane.left == 0; });
    for (;;) {
      int entered = 0;
      for (int l = 0; l < kWidth; ++l)
        while (!lanes_[l].busy && !queue_.is_empty())
          if (load_lane(l, queue_.take())) ++entered;
      if (entered == 0) break;
      load_new();
      evaluate_new(entered);
    }
    return measure();
  }

  /// Sweeps until the first chunk ends, and what follows a chunk in the lanes where one has ended.
  void advance() {
    compose();
    const Index count = sweeps_to_go();
    SiMomentum<Packed> momentum = momentum_of_lanes();
    run_sweeps(team_, env_, pack_, params_, count, momentum);
    end_chunks(count, momentum);
  }
  /// Advances two packs, which alternate.
  static void advance(BodyPackRun& a, BodyPackRun& b) {
    a.compose();
    b.compose();
    const Index count = smaller_of(a.sweeps_to_go(), b.sweeps_to_go());
    NumberPair<SiMomentum<Packed>> momentum{a.momentum_of_lanes(), b.momentum_of_lanes()};
    run_sweeps(a.team_, EnvPair<PackEnv<Real, kWidth>>{a.env_, b.env_}, SystemPair<const Lanes>{a.pack_, b.pack_},
               a.params_, count, momentum);
    a.end_chunks(count, momentum.a);
    b.end_chunks(count, momentum.b);
  }

 private:
  /// The system in a lane, as the body of a single environment knows it.
  typename Lanes::OneLane system_of(int l) const {
    typename Lanes::OneLane system(shape_.contacts, shape_.bodies, params_, memory_ + l, exact_.twists + l);
    system.contacts = lanes_[l].env.kept;
    system.bodies = lanes_[l].env.bodies;
    return system;
  }

  /// In the lanes that `is_due` says, all of them busy, a chunk has ended: check_bodies() finishes the environment, or
  /// it begins another.
  template <class F>
  void check_convergence(F&& is_due) {
    AskedLanes<Real, kWidth> asked;
    SiPoll polls[kWidth];
    unsigned due = 0;
    for (int l = 0; l < kWidth; ++l) {
      Lane& lane = lanes_[l];
      if (!lane.busy || !is_due(lane)) continue;
      due |= 1U << l;
      const auto system = system_of(l);
      if (!reach_last_substep(team_, lane.env, system, params_, lane.progress)) continue;
      polls[l] = poll_last_substep(team_, system, params_, lane.progress);
      if (!polls[l].is_asked) continue;
      set_exact(l);
      asked.add(l, lane.env);
    }
    FinalResidual evaluated[kWidth];
    evaluate_body_lanes(env_, pack_, params_, exact_, asked, evaluated);
    for (int l = 0; l < kWidth; ++l) {
      if ((due >> l & 1U) == 0) continue;
      Lane& lane = lanes_[l];
      const auto system = system_of(l);
      if (asked.env[l] != nullptr) {
        const double absolute = reported_residual(evaluated[l], params_.tolerance * lane.progress.scale);
        lane.busy = !finalize_bodies(team_, lane.env, system, params_, polls[l], absolute, lane.progress);
        if (!lane.busy) continue;
      }
      lane.left = next_chunk(params_, lane.progress);
      if (lane.progress.step != lane.substep) load_lane_free(pack_, lane.env, system, params_, l);
      lane.substep = lane.progress.step;
    }
  }

  /// Takes an environment's numbers into a lane. Whether they can be used.
  bool load_lane(int l, Offset env) {
    Lane& lane = lanes_[l];
    lane.env = slice_bodies(job_, env);
    lane.busy = lane.is_new = admit_bodies(team_, lane.env, params_, lane.progress);
    if (!lane.busy) return false;
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

  /// Computes what follows from the numbers that have entered. An environment that cannot be solved is answered.
  void load_new() {
    measure();
    compose();
    Packed kept(0), entering(0), warm(0);
    for (int l = 0; l < kWidth; ++l) {
      const Lane& lane = lanes_[l];
      if (!lane.busy) continue;
      kept.v[l] = static_cast<Real>(lane.env.kept);
      if (!lane.is_new) continue;
      entering.v[l] = kept.v[l];
      if (is_warm(lane.env, lane.progress.flags)) warm.v[l] = Real(1);
      set_exact(l);
      load_lane_free(pack_, lane.env, system_of(l), params_, l);
    }
    const auto bad = load_contacts(env_, pack_, params_, kept, warm > Packed(0));
    double largest[kWidth];
    begin_lanes(env_, pack_, params_, exact_, entering, largest);
    for (int l = 0; l < kWidth; ++l) {
      Lane& lane = lanes_[l];
      if (!lane.is_new) continue;
      const std::uint32_t flags = is_set(bad, l) ? kFlagBadDiagonal : 0U;
      lane.busy = lane.is_new = is_sound(team_, lane.env, params_, flags, lane.progress);
      if (!lane.busy) {
        is_composed_ = false;
        continue;
      }
      set_out(lane.progress, largest[l]);
      if (!(largest[l] > 0.0)) rest(team_, system_of(l));
    }
  }

  /// First looks at the environments that have entered; some are answered by that.
  void evaluate_new(int entered) {
    // A look at all lanes takes as long as some at one each.
    const bool is_together = 4 * entered > kWidth;
    if (is_together) {
      const auto due = lanes_where([](const Lane& lane) { return lane.is_new; });
      refresh_lanes(env_, pack_, due);
      if (params_.momentum) start_momentum_in(pack_, due);
      keep_estimates(due);
    }
    for (int l = 0; l < kWidth; ++l) {
      Lane& lane = lanes_[l];
      if (!lane.is_new) continue;
      if (!is_together) evaluate_first(team_, lane.env, system_of(l), params_, lane.progress);
      lane.substep = 0;
    }
    check_convergence([](const Lane& lane) { return lane.is_new; });
    for (Lane& lane : lanes_) lane.is_new = false;
  }

  /// How much of the pack is in use. Whether any.
  bool measure() {
    pack_.contacts = pack_.bodies = 0;
    bool is_busy = false;
    for (const Lane& lane : lanes_) {
      if (!lane.busy) continue;
      is_busy = true;
      pack_.contacts = larger_of(pack_.contacts, lane.env.kept);
      pack_.bodies = larger_of(pack_.bodies, lane.env.bodies);
    }
    return is_busy;
  }

  /// Brings what the pack keeps of all lanes together up to date.
  void compose() {
    if (is_composed_) return;
    write_sides(env_.sides, lanes_, pack_.contacts);
    for (Offset side_index = 0; side_index < 2 * Offset{pack_.contacts}; ++side_index)
      if (const auto slots = slot_of(env_.side(side_index)); !slots.is_uniform) pack_.keep_masses(slots);
    is_composed_ = true;
  }

  template <class F>
  PackMask<Real, kWidth> lanes_where(F&& f) const {
    Packed chosen(0);
    for (int l = 0; l < kWidth; ++l) chosen.v[l] = lanes_[l].busy && f(lanes_[l]) ? Real(1) : Real(0);
    return chosen > Packed(0);
  }

  void keep_estimates(PackMask<Real, kWidth> due) {
    const Packed estimate = estimate_residual(team_, env_, pack_);
    for (int l = 0; l < kWidth; ++l)
      if (due.v[l] != 0) lanes_[l].progress.estimate = estimate.v[l];
  }

  /// Sweeps until the first chunk ends.
  [[nodiscard]] Index sweeps_to_go() const {
    Index count = kSiChunk;
    for (const Lane& lane : lanes_)
      if (lane.busy) count = smaller_of(count, lane.left);
    return count;
  }

  [[nodiscard]] SiMomentum<Packed> momentum_of_lanes() const {
    SiMomentum<Packed> momentum;
    for (int l = 0; l < kWidth; ++l) {
      if (!lanes_[l].busy) continue;
      momentum.theta.v[l] = lanes_[l].progress.momentum.theta;
      momentum.progress.v[l] = lanes_[l].progress.momentum.progress;
    }
    return momentum;
  }

  /// After so many sweeps: what follows a chunk in the lanes where one has ended. Of two packs that alternate, one may
  /// have no such lane.
  void end_chunks(Index count, const SiMomentum<Packed>& momentum) {
    for (int l = 0; l < kWidth; ++l) {
      Lane& lane = lanes_[l];
      if (!lane.busy) continue;
      lane.progress.momentum = {momentum.theta.v[l], momentum.progress.v[l]};
      lane.left -= count;
      if (lane.left == 0) lane.progress.done += next_chunk(params_, lane.progress);
    }
    const auto due = lanes_where([](const Lane& lane) { return lane.left == 0; });
    if (!any(due)) return;
    refresh_lanes(env_, pack_, due);
    keep_estimates(due);
  }

  const BodyJob<Real>& job_;
  EnvQueue& queue_;
  SiParams params_;
  cpu::PackShape shape_;
  Real* memory_;
  ExactWorkspace exact_;
  SerialTeam team_;
  Lanes pack_;
  PackEnv<Real, kWidth> env_;
  Lane lanes_[kWidth];
  bool is_composed_ = false;  ///< none has entered since compose()
};

/// Whether environments of this room go through two packs that alternate: as long as the second-level cache holds both.
/// Only speed depends on it.
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
  const bool momentum = job.options.momentum;
  EnvQueue queue{envs, count};
  Run one(job, queue, shape, memory, exact);
  if (takes_body_pairs<kLaw, Real>(shape, momentum) && count >= kShortestForPairs * kPackWidth<Real>) {
    Run other(job, queue, shape, memory + BodyPackMemory<kLaw, Real>::elements(shape, momentum),
              exact + BodyPackMemory<kLaw, Real>::exact_elements(shape));
    run_out(one, other);
  } else {
    run_out(one);
  }
}

}  // namespace stiction::inline STICTION_ISA
