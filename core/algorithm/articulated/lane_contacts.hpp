#pragma once

#include "core/algorithm/articulated/row_classes.hpp"

/// The contacts of a pack's robots, those of a class side by side.
namespace stiction::inline STICTION_ISA {

/// f(number of one, number of the other) of all numbers but the power.
template <class T, class Real, class F>
STICTION_HD void for_each_number(const RowGive<T>& from, RowGive<Real>& to, F&& f) {
  f(from.low, to.low);
  f(from.rise, to.rise);
  f(from.inverse_width, to.inverse_width);
  f(from.middle, to.middle);
  f(from.up, to.up);
  f(from.down, to.down);
  f(from.stiffness, to.stiffness);
  f(from.damping, to.damping);
  f(from.tangential_damping, to.tangential_damping);
  f(from.weight, to.weight);
}
template <class Real>
STICTION_HD RowGive<Real> in_lanes(const RowGive<Scalar<Real>>& give) {
  RowGive<Real> to;
  for_each_number(give, to, [](Scalar<Real> number, Real& lanes) { lanes = Real(number); });
  to.power = give.power;
  return to;
}

/// A contact of every lane: of different pairs, but of one class.
template <class Real>
struct LaneContacts {
  Mask<Real> has;
  Real depth;
  Vector3<Real> point, normal, hint;
  RowGive<Real> give;
  Real friction[kMaxConeRows - 1], ratio[kMaxConeRows];

  /// Lets compliances follow friction that lanes have of their own, as a model's follow its own.
  STICTION_HD void follow_friction(const ArticulatedModelView<Scalar<Real>>& model, Index dim) {
    const Real slide = friction[0] * friction[0], impratio(model.impratio);
    if (!model.is_elliptic && dim > 1) {
      ratio[1] = div_(Real(2) * slide, impratio);
      give.weight = give.weight + slide * give.weight;
      return;
    }
    for (Index k = 1; k < dim; ++k) ratio[k] = div_(div_(slide, friction[k - 1] * friction[k - 1]), impratio);
  }
};

/// The direction that the first tangent is made of, as MuJoCo's mju_makeFrame has it: a capsule's axis on a plane,
/// else y, else z.
template <class Wide, int kStride>
STICTION_HD Vector3<Wide> hint_of(const Robots<Wide, kStride>& robots, const ArticulatedPairData<Scalar<Wide>>& pair,
                                  const Vector3<Wide>& normal) {
  const auto &a = robots.model.geom[pair.geom_a], &b = robots.model.geom[pair.geom_b];
  if (a.kind == GeomKind::plane && b.kind == GeomKind::capsule) return robots.work.geom_axes[pair.geom_b].z;
  const auto is_flat = abs_(normal.y) < Wide(Scalar<Wide>(0.5));
  return {Wide(0), select(is_flat, Wide(1), Wide(0)), select(is_flat, Wide(0), Wide(1))};
}

/// The contacts that lanes have as their number `rank` in a class. Lanes without one have the numbers of another's.
template <class Wide, int kStride>
STICTION_HD LaneContacts<Wide> find_contacts(const Robots<Wide, kStride>& robots, const RowClass& rows, Index rank) {
  using T = Scalar<Wide>;
  const auto& work = robots.work;
  LaneContacts<Wide> found;
  bool is_first = true;
  for_each_of_rank(robots, rows, rank, [&](const RowGroup& group, Mask<Wide> where) {
    const ArticulatedPairData<T>& pair = robots.model.pair[group.pair];
    const auto put = [&](const Wide& value, Wide& into) { into = is_first ? value : select(where, value, into); };
    const auto put3 = [&](const Vector3<Wide>& value, Vector3<Wide>& into) {
      put(value.x, into.x);
      put(value.y, into.y);
      put(value.z, into.z);
    };
    put(work.distance[group.index] - Wide(pair.margin), found.depth);
    put3(work.point[group.index], found.point);
    put3(work.normal[group.index], found.normal);
    if (rows.dim > 1) put3(hint_of(robots, pair, work.normal[group.index]), found.hint);
    for_each_number(pair.give, found.give, [&](T number, Wide& lanes) { put(Wide(number), lanes); });
    for (Index k = 0; k + 1 < rows.dim; ++k) put(friction_of(robots, group.pair, k), found.friction[k]);
    for (Index k = 0; k < rows.dim; ++k) put(Wide(pair.ratio[k]), found.ratio[k]);
    found.give.power = pair.give.power;
    found.has = is_first ? where : or_(found.has, where);
    is_first = false;
  });
  if (own_numbers(robots, VariedArray::pair_friction).data != nullptr) found.follow_friction(robots.model, rows.dim);
  return found;
}

/// Directions of rows: normal, then tangents, if there are any.
template <class Wide>
STICTION_HD Axes3<Wide> frame_of(const LaneContacts<Wide>& contact, Index dim) {
  const Vector3<Wide>& normal = contact.normal;
  if (dim == 1) return {normal, {}, {}};
  const Vector3<Wide> rest = add_scaled(contact.hint, -dot(normal, contact.hint), normal);
  const Vector3<Wide> first =
      direction_of(rest, Vector3<Wide>{Wide(1), Wide(0), Wide(0)}, Wide(static_cast<Scalar<Wide>>(1e-15)));
  return {normal, first, cross(normal, first)};
}

}  // namespace stiction::inline STICTION_ISA
