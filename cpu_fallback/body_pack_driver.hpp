#pragma once

#include <algorithm>

#include "core/body/bodies/body_pack.hpp"
#include "cpu_fallback/bodies_job.hpp"
#include "cpu_fallback/pack_width.hpp"

/// Feeds body environments through the lanes of a pack. Compiled once per instruction set.
namespace stiction::inline STICTION_ISA {

/// The memory of a pack for environments of at most `room`, cut into what it keeps. All of it lies in numbers of Real,
/// but the twists in double.
template <Law kLaw, class Real>
struct BodyPackMemory {
  static constexpr int kWidth = kPackWidth<Real>;
  using Lanes = BodyPack<Real, kWidth, kLaw>;
  using Sides = PackSides<Real, kWidth>;
  using Word = typename Sides::Word;

  static Offset numbers(const cpu::BodyRoom& room, bool momentum) {
    return Lanes::elements(room.contacts, room.bodies, momentum) * kWidth;
  }
  static Offset words(const cpu::BodyRoom& room) { return 2 * Offset{room.contacts} * kWidth; }
  /// With the flags of sides, one byte each, at the end.
  static Offset elements(const cpu::BodyRoom& room, bool momentum) {
    return numbers(room, momentum) + words(room) + 2 * Offset{room.contacts};
  }
  static Sides sides(const cpu::BodyRoom& room, bool momentum, Real* memory) {
    static_assert(sizeof(Word) == sizeof(Real));
    Real* const words_begin = memory + numbers(room, momentum);
    return {reinterpret_cast<Word*>(words_begin), reinterpret_cast<std::uint8_t*>(words_begin + words(room))};
  }
};

/// What a lane works on.
template <class Real>
struct BodyLane {
  BodyEnv<Real> env;
  SiProgress<Real> progress;
  Index left = 0;     ///< sweeps until its chunk ends
  Index substep = 0;  ///< the one that the pack has the free twists of
  Index written = 0;  ///< positions that hold contacts, of this environment or of one before
  bool busy = false;
};

/// The sides of all lanes, once more after some lanes have another environment.
template <class Real, int W>
void write_sides(const PackSides<Real, W>& sides, const BodyLane<Real> (&lanes)[W], Index contacts) {
  for (Offset place = 0; place < 2 * Offset{contacts}; ++place) {
    Index slot = -1;
    bool uniform = true;
    for (const BodyLane<Real>& lane : lanes) {
      if (!lane.busy || place >= 2 * Offset{lane.env.kept}) continue;
      const Index own = slot_of(lane.env.side(place));
      if (slot < 0) slot = own;
      uniform = uniform && own == slot;
    }
    sides.is_uniform[place] = uniform ? 1 : 0;
    for (int l = 0; l < W; ++l)
      sides.side[place * W + l] =
          lanes[l].busy && place < 2 * Offset{lanes[l].env.kept} ? lanes[l].env.side(place) : ~slot;
  }
}

/// As solve_pack(): environments enter and leave lanes between chunks, each with its own count of sweeps, so what one
/// computes does not depend on its lane, its neighbours or the moment it entered.
template <Law kLaw, class Real>
void solve_body_pack(const BodyJob<Real>& job, const Offset* envs, Offset count, const cpu::BodyRoom& room,
                     Real* memory, double* exact) {
  using Memory = BodyPackMemory<kLaw, Real>;
  using Lanes = typename Memory::Lanes;
  using Packed = typename Lanes::Real;
  constexpr int kWidth = Memory::kWidth;
  const SiParams params = si_params(job.stepping, job.options);
  SerialBlock block;
  // Idle lanes compute on whatever they hold; they must hold numbers only so that no slow path is taken.
  std::fill_n(memory, Memory::numbers(room, params.momentum), Real(0));
  Lanes pack(room.contacts, room.bodies, params, memory);
  const PackEnv<Real, kWidth> pack_env{Memory::sides(room, params.momentum, memory)};
  BodyLane<Real> lanes[kWidth];
  const auto system_of = [&](int l) {
    typename Lanes::OneLane system(room.contacts, room.bodies, params, memory + l, exact + l);
    system.contacts = lanes[l].env.kept;
    system.bodies = lanes[l].env.bodies;
    return system;
  };
  Offset next = 0;
  int busy = 0;
  for (;;) {
    bool entered = false;
    for (int l = 0; l < kWidth; ++l) {
      BodyLane<Real>& lane = lanes[l];
      if (lane.busy && lane.left == 0) {
        if (settle_bodies(block, lane.env, system_of(l), params, lane.progress)) {
          lane.busy = false;
          --busy;
        } else {
          lane.left = next_chunk(params, lane.progress);
          if (lane.progress.step != lane.substep) load_lane_free(pack, lane.env, system_of(l), params, l);
          lane.substep = lane.progress.step;
        }
      }
      while (!lane.busy && next < count) {
        lane.env = slice_bodies(job, envs[next++]);
        const auto system = system_of(l);
        lane.written = std::max(lane.written, lane.env.kept);
        if (!start_bodies(block, lane.env, system, params, lane.progress)) continue;
        if (settle_bodies(block, lane.env, system, params, lane.progress)) continue;
        lane.left = next_chunk(params, lane.progress);
        lane.substep = lane.progress.step;
        rest_from(pack, lane.env.kept, lane.written, l);
        lane.written = lane.env.kept;
        load_lane_tangents(pack, system, l);
        load_lane_free(pack, lane.env, system, params, l);
        lane.busy = entered = true;
        ++busy;
      }
    }
    if (busy == 0) return;
    Index run = kSiChunk;
    pack.contacts = pack.bodies = 0;
    SiMomentum<Packed> momentum;
    for (int l = 0; l < kWidth; ++l) {
      const BodyLane<Real>& lane = lanes[l];
      if (!lane.busy) continue;
      run = std::min(run, lane.left);
      pack.contacts = std::max(pack.contacts, lane.env.kept);
      pack.bodies = std::max(pack.bodies, lane.env.bodies);
      momentum.theta.v[l] = lane.progress.momentum.theta;
      momentum.progress.v[l] = lane.progress.momentum.progress;
    }
    if (entered) {
      write_sides(pack_env.sides, lanes, pack.contacts);
      for (Offset place = 0; place < 2 * Offset{pack.contacts}; ++place)
        if (const auto slots = slot_of(pack_env.side(place)); !slots.is_uniform) pack.keep_masses(slots);
    }
    run_sweeps(block, pack_env, pack, params, run, momentum);
    Packed due(0);
    for (int l = 0; l < kWidth; ++l) {
      BodyLane<Real>& lane = lanes[l];
      if (!lane.busy) continue;
      lane.progress.momentum = {momentum.theta.v[l], momentum.progress.v[l]};
      lane.left -= run;
      due.v[l] = lane.left == 0 ? Real(1) : Real(0);
    }
    if (!any(due > Packed(0))) continue;
    refresh_lanes(pack_env, pack, due > Packed(0));
    const Packed estimate = estimate_residual(block, pack_env, pack);
    for (int l = 0; l < kWidth; ++l) {
      BodyLane<Real>& lane = lanes[l];
      if (!lane.busy || lane.left > 0) continue;
      lane.progress.estimate = estimate.v[l];
      lane.progress.done += next_chunk(params, lane.progress);
    }
  }
}

}  // namespace stiction::inline STICTION_ISA
