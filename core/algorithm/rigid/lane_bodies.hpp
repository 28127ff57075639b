#pragma once

#include "core/algorithm/pack/pack_workspace.hpp"
#include "core/algorithm/rigid/body_pack.hpp"

/// Environments that enter lanes of a body pack together, and those that may have their answers together. It does
/// the work of load_bodies(), begin_substep() and residual_of() for all at once, by the same functions. Host
/// only.
namespace stiction::inline STICTION_ISA {

/// Beside a pack's system, numbers of double of all lanes side by side, by body as in BodySystem::exact.
struct ExactWorkspace {
  double* twists;  ///< free ones, or those under the returned impulses  (6 * (bodies + 1); W)
  double* sums;    ///< impulses on the bodies while those are computed  (6 * (bodies + 1); W)
};

/// Neighbouring lanes of a pack, from `first` on, as doubles: as many as a vector holds.
template <class T, int W, Law kLaw>
struct WideLanes {
  static constexpr int kLanes = kWideLanes<T, W>;
  using Real = Pack<double, kLanes>;
  using System = BodyPack<T, W, kLaw>;
  const System& s;
  int first;

  [[nodiscard]] Real number(const Pack<T, W>& lanes) const { return widened(lanes, first); }
  [[nodiscard]] ExactGeometry<Real> geometry(Index p) const {
    const auto vector = [&](Index field) {
      return Vector3<Real>{number(s.field.at(field, p)), number(s.field.at(field + 1, p)),
                           number(s.field.at(field + 2, p))};
    };
    return {vector(kFieldArmA), vector(kFieldArmB), frame_of(vector(kFieldNormal))};
  }
  [[nodiscard]] Twist<Real> start(const LaneSlots<T, W>& at) const {
    Real row[6];
    read<System::kTwistRow>(reinterpret_cast<const T*>(s.start.data), at, row);
    return twist_at<Real>(row);
  }
  [[nodiscard]] InverseMass<Real> mass(const LaneSlots<T, W>& at) const {
    Real row[7];
    read<System::kMassRow>(reinterpret_cast<const T*>(s.mass.data), at, row);
    return {row[0], {row[1], row[2], row[3], row[4], row[5], row[6]}};
  }
  [[nodiscard]] Twist<Real> twist(const double* twists, const LaneSlots<T, W>& at) const {
    Real row[6];
    read<6>(twists, at, row);
    return twist_at<Real>(row);
  }
  void set_twist(double* twists, const LaneSlots<T, W>& at, const Twist<Real>& twist) const {
    const Real row[6] = {twist.linear.x,  twist.linear.y,  twist.linear.z,
                         twist.angular.x, twist.angular.y, twist.angular.z};
    for (int k = 0; k < 6; ++k) {
      if (at.is_uniform) {
        store_lanes(twists + (6 * static_cast<Offset>(at.slot[0]) + k) * W + first, row[k]);
      } else {
        for (int l = 0; l < kLanes; ++l)
          twists[(6 * static_cast<Offset>(at.slot[first + l]) + k) * W + first + l] = row[k].v[l];
      }
    }
  }
  /// The slot of a body in every lane.
  [[nodiscard]] static LaneSlots<T, W> slot(Index body) {
    LaneSlots<T, W> at{};
    at.slot = at.slot + body;
    at.is_uniform = true;
    return at;
  }

 private:
  /// The first numbers of rows of kRow numbers, each side by side with those of the other lanes.
  template <Index kRow, class U, int kCount>
  void read(const U* rows, const LaneSlots<T, W>& at, Real (&row)[kCount]) const {
    if (at.is_uniform) {
      const U* const from = rows + Offset{kRow} * static_cast<Offset>(at.slot[0]) * W + first;
      for (int k = 0; k < kCount; ++k) widen_lanes(from + k * W, row[k]);
    } else {
      const U* from[kLanes];
      for (int l = 0; l < kLanes; ++l)
        from[l] = rows + Offset{kRow} * static_cast<Offset>(at.slot[first + l]) * W + first + l;
      for (int k = 0; k < kCount; ++k) {
        Real together(0.0);
        for (int l = 0; l < kLanes; ++l) together.v[l] = static_cast<double>(from[l][k * W]);
        row[k] = together;
      }
    }
  }
};

/// Loads contacts whose numbers are in the lanes, and the tangents. `kept`: contacts of each lane; `warm`: those that
/// enter with a warm start. It is done for those that are there already, and gives the same numbers. Returns in which
/// lanes a contact cannot be solved.
template <class T, int W, Law kLaw>
PackMask<T, W> load_contacts(const PackEnv<T, W>& env, const BodyPack<T, W, kLaw>& s, const SiParams& params,
                             Pack<T, W> kept, PackMask<T, W> warm) {
  using Real = Pack<T, W>;
  auto bad = Real(0) > Real(0);
  for (Index p = 0; p < s.contacts; ++p) {
    const ContactFrame<Real> frame = frame_of(s.vector(kFieldNormal, p));
    const Real tangents[6] = {frame.t1.x, frame.t1.y, frame.t1.z, frame.t2.x, frame.t2.y, frame.t2.z};
    for (Index k = 0; k < 6; ++k) s.tangents.at(k, p) = tangents[k];
    const auto can_solve = load_contact(s, p, frame, slot_of(env.side(2 * static_cast<Offset>(p))),
                                        slot_of(env.side(2 * static_cast<Offset>(p) + 1)));
    const auto exists = Real(static_cast<T>(p)) < kept;
    bad = or_(bad, and_(exists, not_(can_solve)));
    if (any(not_(exists)))
      for (Index k = kFieldWeight; k < kContactFields<kLaw>; ++k)
        s.field.at(k, p) = select(exists, s.field.at(k, p), Real(0));
    if (any(warm)) start_impulse(s, params, p, warm);
  }
  return bad;
}

/// begin_substep() of those that enter, but for islands: biases, error scales of contacts, and the largest of each
/// lane. `kept`: contacts of the lanes that enter, 0 in the others. The workspace has their free twists.
template <class T, int W, Law kLaw>
void begin_lanes(const PackEnv<T, W>& env, const BodyPack<T, W, kLaw>& s, const SiParams& params,
                 const ExactWorkspace& workspace, Pack<T, W> kept, ErrorScale (&scales)[W]) {
  using Lanes = WideLanes<T, W, kLaw>;
  using Wide = typename Lanes::Real;
  const auto put = [&](Pack<T, W>& to, int first, Mask<Wide> exists, const Wide& value) {
    store_lanes(reinterpret_cast<T*>(&to) + first,
                narrowed<Pack<T, Lanes::kLanes>>(select(exists, value, widened(to, first))));
  };
  for (int first = 0; first < W; first += Lanes::kLanes) {
    const Lanes lanes{s, first};
    const auto find_b = [&](Index p, Wide(&b)[3]) {
      const auto side_a = slot_of(env.side(2 * static_cast<Offset>(p)));
      const auto side_b = slot_of(env.side(2 * static_cast<Offset>(p) + 1));
      const ExactGeometry<Wide> contact = lanes.geometry(p);
      const Wide bias = bias_of(params, contact, lanes.start(side_a), lanes.start(side_b),
                                lanes.number(s.depth.at(0, p)), lanes.number(s.restitution[p]));
      free_motion(contact, lanes.twist(workspace.twists, side_a), lanes.twist(workspace.twists, side_b), bias, b);
      return bias;
    };
    const auto exists_at = [&](Index p) { return Wide(static_cast<double>(p)) < lanes.number(kept); };
    Wide largest(0.0);
    for (Index p = 0; p < s.contacts; ++p) {
      const auto exists = exists_at(p);
      if (!any(exists)) continue;
      Wide b[3];
      const Wide bias = find_b(p, b);
      const auto held = lanes.number(s.field.at(kFieldPress, p)) == Wide(0.0);
      put(s.field.at(kFieldBias, p), first, exists, select(held, Wide(static_cast<double>(kHeldBias)), bias));
      for (int k = 0; k < 3; ++k) largest = select(exists, max_(abs_(b[k]), largest), largest);
    }
    double units[Lanes::kLanes];
    for (int l = 0; l < Lanes::kLanes; ++l) units[l] = error_unit(largest.v[l]);
    Wide unit;
    load_lanes(units, unit);
    Wide most(0.0);
    Wide of_held(0.0);
    for (Index p = 0; p < s.contacts; ++p) {
      const auto exists = exists_at(p);
      if (!any(exists)) continue;
      Wide b[3];
      find_b(p, b);
      const auto field = [&](Index k) { return lanes.number(s.field.at(k, p)); };
      const auto metric = contact_metric(field(kFieldPress), field(kFieldPress + 1), field(kFieldPress + 2));
      const Wide own = within_range<T>(error_at_rest<kLaw>(b, field(kFieldMu), metric, unit));
      put(s.field.at(kFieldShare, p), first, exists, own);
      const auto held = field(kFieldPress) == Wide(0.0);
      most = select(and_(exists, not_(held)), max_(field(kFieldShare), most), most);
      of_held = select(and_(exists, held), max_(field(kFieldShare), of_held), of_held);
    }
    most = select(most > Wide(0.0), most, of_held);
    for (int l = 0; l < Lanes::kLanes; ++l) scales[first + l] = {max_(most.v[l], 1e-300), units[l]};
  }
}

/// The lanes whose best iterates are judged.
template <class T, int W>
struct AskedLanes {
  const BodyEnv<T>* env[W] = {};  ///< null: not asked
  Index contacts = 0;             ///< the most of an asked environment
  Index bodies = 0;
  Pack<T, W> kept{0};  ///< contacts of each

  void add(int lane, const BodyEnv<T>& asked) {
    env[lane] = &asked;
    kept.v[lane] = static_cast<T>(asked.kept);
    contacts = contacts > asked.kept ? contacts : asked.kept;
    bodies = bodies > asked.bodies ? bodies : asked.bodies;
  }
  [[nodiscard]] bool is_empty(int first, int count) const {
    for (int l = first; l < first + count; ++l)
      if (env[l] != nullptr) return false;
    return true;
  }
};

/// residual_of() the best iterates of asked lanes, from `first` on.
template <class T, int W, Law kLaw>
struct LaneJudge {
  using Lanes = WideLanes<T, W, kLaw>;
  using Wide = typename Lanes::Real;
  const PackEnv<T, W>& env;
  const BodyPack<T, W, kLaw>& s;
  const SiParams& params;
  const ExactWorkspace& workspace;
  const AskedLanes<T, W>& asked;
  Lanes lanes;

  [[nodiscard]] Mask<Wide> exists(Index p) const { return Wide(static_cast<double>(p)) < lanes.number(asked.kept); }
  [[nodiscard]] LaneSlots<T, W> slot(Index p, int side) const {
    return slot_of(env.side(2 * static_cast<Offset>(p) + side));
  }
  /// returned_impulse(); zero where there is no contact.
  void impulses(Index p, Wide (&lambda)[3]) const {
    const auto is_here = exists(p);
    for (Index k = 0; k < 3; ++k) {
      const Pack<T, W> x = s.best.at(k, p);
      const Pack<T, W> value = canonical_zero(k == 0 ? x : x * s.field.at(kFieldMu, p));
      lambda[k] = select(is_here, lanes.number(value), Wide(0.0));
    }
  }

  /// gather_exact(): contacts in order instead of bodies one by one, which gives each body's sum the same terms in the
  /// same order. Terms are not read where nothing is pushed. The workspace has free twists.
  void gather() const {
    const Vector3<Wide> zero{Wide(0.0), Wide(0.0), Wide(0.0)};
    for (Index body = 0; body <= asked.bodies; ++body) lanes.set_twist(workspace.sums, Lanes::slot(body), {zero, zero});
    const auto add = [&](const LaneSlots<T, W>& at, const Vector3<Wide>& arm, const Vector3<Wide>& impulse) {
      const Twist<Wide> sum = lanes.twist(workspace.sums, at);
      lanes.set_twist(workspace.sums, at,
                      {add_scaled(sum.linear, Wide(1.0), impulse), add_cross(sum.angular, arm, impulse)});
    };
    for (Index p = 0; p < asked.contacts; ++p) {
      const ExactGeometry<Wide> contact = lanes.geometry(p);
      Wide lambda[3];
      impulses(p, lambda);
      const Vector3<Wide> impulse = to_world(contact.frame, lambda[0], lambda[1], lambda[2]);
      add(slot(p, 0), contact.arm_a, opposite(impulse));
      add(slot(p, 1), contact.arm_b, impulse);
    }
    for (Index body = 0; body < asked.bodies; ++body) {
      const auto at = Lanes::slot(body);
      const Twist<Wide> sum = lanes.twist(workspace.sums, at);
      const Twist<Wide> free = lanes.twist(workspace.twists, at);
      const Twist<Wide> moved = pushed(free, lanes.mass(at), sum.linear, sum.angular);
      lanes.set_twist(workspace.twists, at, where(is_pushed(body), moved, free));
    }
  }

  /// The largest errors of each lane; motion goes to the batch.
  [[nodiscard]] LargestResidual<Wide> evaluate(const Wide& unit) const {
    const Wide r(div_(params.cfm, params.step));
    LargestResidual<Wide> evaluated;
    for (Index p = 0; p < asked.contacts; ++p) {
      const auto a = slot(p, 0);
      const auto b = slot(p, 1);
      const ExactGeometry<Wide> contact = lanes.geometry(p);
      const auto bias = [&] {
        return bias_of(params, contact, lanes.start(a), lanes.start(b), lanes.number(s.depth.at(0, p)),
                       lanes.number(s.restitution[p]));
      };
      Wide lambda[3];
      impulses(p, lambda);
      Wide motion[3];
      LargestResidual<Wide> with_this = evaluated;
      evaluate_contact<kLaw, Wide>(
          contact, [&](int side) { return lanes.twist(workspace.twists, side == 0 ? a : b); },
          [&](int side) { return lanes.mass(side == 0 ? a : b); }, bias, lanes.number(s.field.at(kFieldMu, p)), r,
          lambda, motion, lanes.number(s.field.at(kFieldShare, p)), unit, with_this);
      const auto is_here = exists(p);
      evaluated = {select(is_here, with_this.square, evaluated.square),
                   select(is_here, with_this.stuck, evaluated.stuck), select(is_here, with_this.plain, evaluated.plain),
                   select(is_here, with_this.size, evaluated.size),
                   select(is_here, with_this.reaction, evaluated.reaction)};
      write_solution(p, motion);
    }
    return evaluated;
  }

 private:
  [[nodiscard]] Mask<Wide> is_pushed(Index body) const {
    Wide marked(0.0);
    for (int l = 0; l < Lanes::kLanes; ++l) {
      const BodyEnv<T>* const one = asked.env[lanes.first + l];
      marked.v[l] = one != nullptr && body < one->bodies && !one->is_kinematic(body) ? 1.0 : 0.0;
    }
    return marked > Wide(0.0);
  }
  static Twist<Wide> where(Mask<Wide> chosen, const Twist<Wide>& a, const Twist<Wide>& b) {
    const auto parts = [chosen](const Vector3<Wide>& u, const Vector3<Wide>& v) {
      return Vector3<Wide>{select(chosen, u.x, v.x), select(chosen, u.y, v.y), select(chosen, u.z, v.z)};
    };
    return {parts(a.linear, b.linear), parts(a.angular, b.angular)};
  }
  void write_solution(Index p, const Wide (&motion)[3]) const {
    for (int l = 0; l < Lanes::kLanes; ++l) {
      const BodyEnv<T>* const one = asked.env[lanes.first + l];
      if (one == nullptr || one->w == nullptr || p >= one->kept) continue;
      T* const w = one->w + 3 * static_cast<Offset>(one->contact_order[p]);
      for (int k = 0; k < 3; ++k) w[k] = canonical_zero(saturated<T>(motion[k].v[l]));
    }
  }
};

/// Judges the best iterates of the lanes in the mask. The workspace has their free twists; afterwards it has those
/// under the reactions.
template <class T, int W, Law kLaw>
void evaluate_body_lanes(const PackEnv<T, W>& env, const BodyPack<T, W, kLaw>& s, const SiParams& params,
                         const ExactWorkspace& workspace, const AskedLanes<T, W>& asked,
                         const ErrorScale* const (&scales)[W], FinalResidual (&evaluated)[W]) {
  using Judge = LaneJudge<T, W, kLaw>;
  constexpr int kLanes = Judge::Lanes::kLanes;
  for (int first = 0; first < W; first += kLanes) {
    if (asked.is_empty(first, kLanes)) continue;
    const Judge evaluate{env, s, params, workspace, asked, {s, first}};
    evaluate.gather();
    Pack<double, kLanes> unit(1.0);
    for (int l = 0; l < kLanes; ++l)
      if (scales[first + l] != nullptr) unit.v[l] = scales[first + l]->unit;
    const auto found = evaluate.evaluate(unit);
    for (int l = 0; l < kLanes; ++l)
      evaluated[first + l] = final_residual_of(
          {found.square.v[l], found.stuck.v[l], found.plain.v[l], found.size.v[l], found.reaction.v[l]},
          {1.0, unit.v[l]});
  }
}

}  // namespace stiction::inline STICTION_ISA
