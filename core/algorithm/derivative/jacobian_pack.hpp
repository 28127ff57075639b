#pragma once

#include <type_traits>

#include "core/algorithm/derivative/find_modes.hpp"
#include "core/algorithm/derivative/jacobian_change.hpp"
#include "core/algorithm/derivative/jacobian_pack_half.hpp"
#include "core/algorithm/derivative/jacobian_pack_limits.hpp"
#include "core/algorithm/derivative/vjp.hpp"
#include "core/algorithm/velocity/solve_pack.hpp"

/// Derivatives of compliant environments of J and M side by side (docs/math/derivative.md, "In lanes"). Both directions
/// have one linear system; its right-hand side and what is written differ. The scalar path solves environments that
/// this one rejects.
namespace stiction::inline STICTION_ISA {

/// Squares of how far an adjoint velocity may be off: it is refined above the first, and is no answer above the second.
/// With R = 1e-5 of A's diagonal, that much of ν's 16 digits is lost and no refinement brings it back.
inline constexpr double kRefineAbove = 1e-24;
inline constexpr double kMostAdjointSquare = 1e-20;

/// `Job`: JacobianVjpJob<Real> or JacobianJvpJob<Real>.
template <class Types, class Job>
class JacobianPack {
 public:
  using Wide = typename Types::Wide;
  using Real = typename Types::Real;
  using Double = typename Types::Double;
  using Half = JacobianPackHalf<Types>;
  static constexpr int kLanes = Types::kLanes;
  static constexpr bool kIsReverse = std::is_same_v<Job, JacobianVjpJob<Real>>;

  STICTION_HD JacobianPack(const Job& job, const LaneEnv<Real> (&envs)[kLanes], const TreeOf<Types>& tree,
                           const SlotOf<Types>* slots, const SlotCounts& counts,
                           const JacobianPackWorkspace<Types>& workspace, JacobianPackResult* results)
      : job_(job), envs_(envs), tree_(tree), slots_(slots), counts_(counts), workspace_(workspace), results_(results) {}

  STICTION_HD_OUTLINE void run() {
    load();
    for_each_half([&](const Half& half) { find_answer(half); });
    for (Offset set = 0; set < job_.contact.count; ++set) {
      if constexpr (kIsReverse) {
        load_cotangents(set);
      } else {
        load_changes(set);
      }
      for_each_half([&](const Half& half) { solve(half); });
      for (int l = 0; l < kLanes; ++l)
        if (lanes_[l].is_answered) write_lane(l, set);
    }
    for (int l = 0; l < kLanes; ++l)
      if (envs_[l].env >= 0) results_[l] = lanes_[l];
  }

 private:
  [[nodiscard]] STICTION_HD const JacobianBatchView<Real>& batch() const { return job_.assembly.batch; }

  template <class F>
  STICTION_HD void for_each_half(F&& f) const {
    for (int first = 0; first < kLanes; first += Types::kDoubleLanes)
      f(Half{workspace_, DoublePack<Types>{workspace_, tree_, slots_, counts_, first, batch().mass_form}});
  }

  STICTION_HD_OUTLINE void load() {
    const Real zeros[kTileReach<Real>] = {};
    load_motion(workspace_, batch(), tree_, envs_, zeros);
    for (Index s = 0; s < counts_.slots; ++s) {
      load_slot(workspace_, batch(), slots_[s], s, envs_, zeros);
      load_by_row<Types, Real>(slots_[s], envs_, job_.contact.at.lambda, Real(0), workspace_.x);
      for (int l = 0; l < kLanes; ++l) workspace_.marks().at(slots_[s].row, l) = mark_of(slots_[s], l);
    }
    auto sound = sound_lanes(workspace_, tree_, slots_, counts_);
    for (Index row = 0; row < counts_.rows; ++row) sound = and_(sound, workspace_.R[row] > Wide(0));
    for (int l = 0; l < kLanes; ++l) {
      const bool has = envs_[l].env >= 0;
      if (has) lanes_[l].scale = results_[l].scale;
      lanes_[l].is_answered = has && is_set(sound, l);
    }
  }
  [[nodiscard]] STICTION_HD Real mark_of(const SlotOf<Types>& slot, int l) const {
    if (slot.row_of[l] < 0) return Real(-1);
    return batch().cone_kind[envs_[l].first_cone + slot.cone_of[l]] == ConeKind::unilateral ? Real(1) : Real(0);
  }

  /// The largest |b|, that of the whole environment in lanes that have a part of one.
  STICTION_HD Double whole_scale(int first, Double own) const {
    double given[Types::kDoubleLanes];
    for (int l = 0; l < Types::kDoubleLanes; ++l) given[l] = lanes_[first + l].scale;
    Double whole;
    load_lanes(given, whole);
    return select(whole > Double(0), whole, own);
  }

  /// The modes of the answer, and H. Answers that a solve would reject are not taken.
  STICTION_HD_OUTLINE void find_answer(const Half& half) {
    const DoublePack<Types>& part = half.part;
    auto definite = part.factor_mass();
    part.find_diagonal();
    const Double error_scale = part.find_scale(Law::convex);
    Double largest(0);  // |b|
    for (Index row = 0; row < counts_.rows; ++row) largest = max_(abs_(part.array(workspace_.motion)[row]), largest);
    const Double scale = whole_scale(part.first, max_(largest, Double(1e-300)));
    const auto evaluated = part.evaluate(Law::convex);
    // Behind an evaluation scratch has M^-1 J' x.
    if constexpr (kIsReverse)
      for (int l = 0; l < Types::kDoubleLanes; ++l) write_moved(part.first + l);
    const auto found = half.find_slopes(Double(job_.contact.tie_tolerance) * scale);
    definite = and_(definite, half.factor_system());
    for (int l = 0; l < Types::kDoubleLanes; ++l) {
      JacobianPackResult& lane = lanes_[part.first + l];
      lane.forward_residual =
          div_(div_(sqrt_(lane_of(evaluated.square, l)), lane_of(part.array(workspace_.error_unit)[0], l)),
               max_(lane_of(error_scale, l), 1e-300));
      lane.unknowns = static_cast<Index>(lane_of(found.unknowns, l));
      lane.degenerate = static_cast<Index>(lane_of(found.degenerate, l));
      lane.is_answered = lane.is_answered && is_set(definite, l) &&
                         lane.forward_residual <= job_.contact.residual_limit && finite_(lane.forward_residual);
    }
  }

  STICTION_HD_OUTLINE void load_cotangents(Offset set) {
    const auto rows_of = [&](const Real* numbers) {
      return numbers == nullptr ? nullptr : numbers + set * batch().row_count;
    };
    for (Index s = 0; s < counts_.slots; ++s) {
      load_by_row<Types, Real>(slots_[s], envs_, rows_of(job_.cotangents.lambda), Real(0), workspace_.lambda_bar());
      load_by_row<Types, Real>(slots_[s], envs_, rows_of(job_.cotangents.w), Real(0), workspace_.w_bar());
    }
    for (int l = 0; l < kLanes; ++l)
      for (Index k = 0; k < tree_.dofs; ++k)
        workspace_.v_bar().at(k, l) = k < envs_[l].dofs && job_.cotangents.velocity != nullptr
                                          ? job_.cotangents.velocity[dof_place(l, k, set)]
                                          : Real(0);
  }
  /// One set's changes of forces, motions and reactions while reactions rest.
  STICTION_HD_OUTLINE void load_changes(Offset set) {
    for (Index row = 0; row < counts_.rows; ++row) {
      workspace_.lambda_bar().put(row, Wide(Real(0)));
      workspace_.w_bar().put(row, Wide(Real(0)));
    }
    for (Index k = 0; k < tree_.dofs; ++k) workspace_.v_bar().put(k, Wide(Real(0)));
    for (int l = 0; l < kLanes; ++l) {
      if (!lanes_[l].is_answered) continue;
      const LaneChange<Types> change{job_, envs_[l], workspace_, set, l};
      change.begin();
      for_each_row(l, set, [&](Index row, Offset at, const RowMode& mode) {
        const RestingChange rest = change_of_row(row, l, at, mode);
        workspace_.w_bar().at(row, l) = static_cast<Real>(rest.reaction);
        workspace_.lambda_bar().at(row, l) = static_cast<Real>(change.motion_of_row(row, at) + rest.test);
      });
      change.finish();
    }
  }

  /// How a row of a lane's cone follows its friction and bounds.
  struct RowMode {
    bool slides;  ///< a tangential row, with its cone
    bool is_box;
  };
  /// Changes of a row while the unknowns rest.
  struct RestingChange {
    double reaction;
    double test;
  };
  /// f(row here, place in arrays by set and row, mode) for the rows of a lane.
  template <class F>
  STICTION_HD void for_each_row(int l, Offset set, F&& f) const {
    for (Index s = 0; s < counts_.slots; ++s) {
      if (slots_[s].row_of[l] < 0) continue;
      const bool is_cone = slots_[s].rows > 1;
      const bool slides = is_cone && workspace_.slope_of_cone[Offset{4 * s + 3} * Types::kStride + l] > 0.0;
      const bool is_box = batch().cone_kind[envs_[l].first_cone + slots_[s].cone_of[l]] == ConeKind::box;
      const Offset first = set * batch().row_count + envs_[l].first_row + slots_[s].row_of[l];
      for (Index k = 0; k < slots_[s].rows; ++k) f(slots_[s].row + k, first + k, RowMode{slides && k > 0, is_box});
    }
  }
  /// A row's reaction by its friction or bound, and the test of its cone by friction.
  STICTION_HD RestingChange change_of_row(Index row, int l, Offset at, const RowMode& mode) const {
    const Offset from = Offset{row} * Types::kStride + l;
    const double bound = mode.is_box ? workspace_.slope_q[from] : 0.0;
    if (bound < 0.0) return {given(job_.tangents.lo, at), 0.0};
    if (bound > 0.0) return {given(job_.tangents.hi, at), 0.0};
    const auto mu = static_cast<double>(workspace_.mu.at(row, l));
    if (!mode.slides || !(mu > 0.0)) return {0.0, 0.0};
    const double share = div_(given(job_.tangents.mu, at), mu);
    return {share * static_cast<double>(workspace_.x.at(row, l)), share * workspace_.motion[from]};
  }

  /// Returns the index of a lane's degree of freedom k in an array by set and degree of freedom.
  [[nodiscard]] STICTION_HD Offset dof_place(int l, Index k, Offset set) const {
    return set * batch().dof_count + batch().env_dof_offsets[envs_[l].env] + dof_of(envs_[l], k);
  }

  /// One set's velocities and reactions.
  STICTION_HD_OUTLINE void solve(const Half& half) {
    half.solve_adjoint();
    half.follow_adjoint();
    Double square = half.adjoint_residual();
    const auto refined = square > Double(kRefineAbove);
    if (any(refined)) {
      half.refine(refined);
      half.follow_adjoint();
      square = half.adjoint_residual();
    }
    Double nothing(0);  // NaN where anything is not finite
    for (Index k = 0; k < tree_.dofs; ++k) nothing = fma_(half.array(workspace_.force)[k], Double(0), nothing);
    for (Index row = 0; row < counts_.rows; ++row)
      nothing = fma_(half.array(workspace_.nu)[row] + half.array(workspace_.image)[row], Double(0), nothing);
    for (int l = 0; l < Types::kDoubleLanes; ++l) {
      JacobianPackResult& lane = lanes_[half.part.first + l];
      const double own = lane_of(square, l);
      lane.is_answered = lane.is_answered && own <= kMostAdjointSquare && lane_of(nothing, l) == 0.0;
      lane.square = max_(own, lane.square);
    }
  }

  STICTION_HD void write_moved(int l) {
    if (!lanes_[l].is_answered) return;
    for (Index k = 0; k < envs_[l].dofs; ++k)
      put(job_.lanes.moved, dof_place(l, k, 0), workspace_.scratch[Offset{k} * Types::kStride + l]);
  }

  /// Writes a lane's answer by degree of freedom and by row. Cotangents of J and M are made of that.
  STICTION_HD void write_lane(int l, Offset set) {
    for (Index k = 0; k < envs_[l].dofs; ++k) {
      const Offset to = dof_place(l, k, set), from = Offset{k} * Types::kStride + l;
      if constexpr (kIsReverse) {
        put(job_.lanes.adjoint, to, workspace_.adjoint[from]);
        put(job_.gradients.v_free, to, workspace_.force[from]);
      } else {
        put(job_.changes.velocity, to, given(job_.tangents.v_free, to) + workspace_.adjoint[from]);
      }
    }
    for_each_row(l, set, [&](Index row, Offset to, const RowMode& mode) {
      if constexpr (kIsReverse) {
        write_cotangents(row, l, to, mode);
      } else {
        const Offset from = Offset{row} * Types::kStride + l;
        put(job_.changes.lambda, to, workspace_.nu[from]);
        put(job_.changes.w, to, workspace_.image[from] - change_of_row(row, l, to, mode).test);
      }
    });
  }

  STICTION_HD void write_cotangents(Index row, int l, Offset to, const RowMode& mode) {
    const Offset from = Offset{row} * Types::kStride + l;
    const double nu = workspace_.nu[from], image = workspace_.image[from];
    const auto lambda = static_cast<double>(workspace_.x.at(row, l)),
               mu = static_cast<double>(workspace_.mu.at(row, l));
    put(job_.nu, to, nu);
    put(job_.gradients.R, to, nu * lambda);
    double by_mu = 0.0;
    if (mode.slides && mu > 0.0)
      by_mu = by_friction(image, lambda, nu, static_cast<double>(workspace_.w_bar().at(row, l)),
                          workspace_.motion[from], mu);
    put(job_.gradients.mu, to, by_mu);
    const double bound = mode.is_box ? workspace_.slope_q[from] : 0.0;
    put(job_.gradients.lo, to, bound < 0.0 ? image : 0.0);
    put(job_.gradients.hi, to, bound > 0.0 ? image : 0.0);
  }

  const Job& job_;
  const LaneEnv<Real> (&envs_)[kLanes];
  const TreeOf<Types>& tree_;
  const SlotOf<Types>* slots_;
  const SlotCounts& counts_;
  const JacobianPackWorkspace<Types>& workspace_;
  JacobianPackResult lanes_[kLanes];
  JacobianPackResult* results_;
};

/// Differentiates up to kLanes environments, or parts of some, that lanes take. The outcome of each is in `results`,
/// which come with the scales of parts. Memory as in solve_pack().
template <class Types, class Job, class Memory>
STICTION_HD_OUTLINE void jacobian_pack(const Job& job, const LaneEnv<typename Types::Real>* members,
                                       JacobianPackResult* results, Index count, Memory&& memory,
                                       ListedCones<Types> listed = nullptr) {
  const bool fits = with_pack<Types>(
      job.assembly.batch, members, count, memory,
      [&](const auto& envs, const auto& lists, const auto& counts) {
        const JacobianPackWorkspace<Types> workspace = memory.jacobian_pack_numbers(lists, counts);
        JacobianPack<Types, Job>(job, envs, *lists.tree, lists.slots, counts, workspace, results).run();
      },
      listed);
  for (Index l = 0; l < count && !fits; ++l) results[l].is_answered = false;
}

}  // namespace stiction::inline STICTION_ISA
