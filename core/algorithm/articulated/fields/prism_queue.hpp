#pragma once

#include "core/algorithm/articulated/fields/prism.hpp"
#include "core/algorithm/articulated/lane_numbers.hpp"
#include "core/algorithm/velocity/lanes/lane_array.hpp"
#include "core/job/articulated_job.hpp"

/// Points at which spheres and capsules touch the prisms of a height field.
namespace stiction::inline STICTION_ISA {

/// The points of a pair in one lane, in the axes of the field. Without room the shallowest one leaves.
template <class T>
struct FieldPoints {
  ContactCandidate<T> at[kMostFieldPoints];
  Index room = 0;
  Index count = 0;
  bool is_full = false;  ///< one was left out

  /// Adds the point of a round shape whose middle line is nearest there.
  STICTION_HD void add(const SurfacePoint<T>& nearest, T radius) {
    const T distance = nearest.distance - radius;
    Index place = count;
    if (count < room) {
      ++count;
    } else {
      is_full = true;
      place = 0;
      for (Index k = 1; k < count; ++k)
        if (at[k].depth < at[place].depth) place = k;
      if (!(-distance > at[place].depth)) return;
    }
    at[place] = {add_scaled(nearest.at, T(0.5) * distance, nearest.normal), nearest.normal, -distance, place};
  }
};

/// Points at which a round shape touches one prism.
template <class T>
struct PrismTouch {
  static constexpr Index kMost = 3;
  SurfacePoint<T> at[kMost];
  Mask<T> has[kMost];
};

/// A sphere has the nearest point. `most`: of the distance from its centre.
template <class T>
STICTION_HD PrismTouch<T> touch_sphere(const FieldPrism<T>& prism, const Vector3<T>& centre, T most) {
  const SurfacePoint<T> nearest = nearest_surface(prism, centre);
  const auto none = T(0) > T(0);
  return {{nearest, nearest, nearest}, {nearest.distance < most, none, none}};
}

/// A capsule has a point where it is nearest, and at either end that is over the prism. `most`: of the distance from
/// the middle line.
template <class T>
STICTION_HD_OUTLINE PrismTouch<T> touch_capsule(const FieldPrism<T>& prism, const Ends<T>& ends, T radius, T most) {
  const T nearer = radius * T(sizeof(Scalar<T>) == sizeof(double) ? 1e-9 : 1e-5);
  const auto is_in = pierces(ends, prism);
  PrismTouch<T> touch{};
  if (any(not_(is_in))) {
    const SurfacePoint<T> end[2] = {nearest_surface(prism, ends.at[0]), nearest_surface(prism, ends.at[1])};
    const auto is_second = end[1].distance < end[0].distance;
    const SurfacePoint<T> middle = nearest_edge(prism, ends.axis);
    const auto is_between = middle.distance < min_(end[1].distance, end[0].distance) - nearer;
    touch.at[0] = middle;
    touch.has[0] = and_(is_between, middle.distance < most);
    for (Index k = 0; k < 2; ++k) {
      const auto is_nearest = and_(k == 0 ? not_(is_second) : is_second, not_(is_between));
      touch.at[1 + k] = end[k];
      touch.has[1 + k] = and_(end[k].distance < most, or_(is_nearest, prism.is_level_with(ends.at[k])));
    }
  }
  if (!any(is_in)) return touch;
  const PrismExit<T> way = way_out(prism, ends, nearer);
  const auto has_other = and_(way.is_by_face, and_(way.out_of_other.distance < most, prism.is_level_with(way.other)));
  touch.at[0] = select(is_in, way.shortest, touch.at[0]);
  touch.at[1] = select(is_in, way.out_of_other, touch.at[1]);
  touch.has[0] = or_(is_in, touch.has[0]);
  touch.has[1] = or_(and_(is_in, has_other), and_(not_(is_in), touch.has[1]));
  touch.has[2] = and_(not_(is_in), touch.has[2]);
  return touch;
}

/// Prisms near round shapes in lanes, all of one size. They wait until there are as many as lanes, and are then looked
/// at together.
template <class Real>
class PrismQueue {
 public:
  using T = Scalar<Real>;
  static constexpr int kLanes = RealTraits<Real>::kLanes;

  /// `found`: of lanes, to which points are added.
  STICTION_HD PrismQueue(bool is_capsule, T radius, T margin, T bottom, FieldPoints<T>* found)
      : is_capsule_(is_capsule), radius_(radius), most_(radius + margin), bottom_(bottom), found_(found) {}

  /// Takes the segment of a lane's shape in, and the top of a prism near it.
  STICTION_HD void add(int lane, const Segment<T>& axis, const Triangle3<T>& top) {
    put_vector(axis_.centre, count_, axis.centre);
    put_vector(axis_.h, count_, axis.h);
    put_vector(top_.a, count_, top.a);
    put_vector(top_.b, count_, top.b);
    put_vector(top_.c, count_, top.c);
    lane_[count_] = lane;
    if (++count_ == kLanes) touch();
  }

  /// Adds the points of all that wait, in their order.
  STICTION_HD_OUTLINE void touch() {
    const int count = count_;
    count_ = 0;
    const FieldPrism<Real> prism(top_, Real(bottom_));
    const Ends<Real> ends(axis_);
    const auto near = is_near(prism, ends, Real(most_));
    if (count == 0 || !any(near)) return;
    const PrismTouch<Real> touch = is_capsule_ ? touch_capsule(prism, ends, Real(radius_), Real(most_))
                                               : touch_sphere(prism, axis_.centre, Real(most_));
    for (int k = 0; k < count; ++k)
      for (Index i = 0; i < touch.kMost; ++i) {
        const SurfacePoint<Real>& at = touch.at[i];
        if (is_set(and_(near, touch.has[i]), k))
          found_[lane_[k]].add({vector_in(at.at, k), vector_in(at.normal, k), number_in(at.distance, k)}, radius_);
      }
  }

 private:
  bool is_capsule_;
  T radius_, most_, bottom_;
  FieldPoints<T>* found_;
  Triangle3<Real> top_{};
  Segment<Real> axis_{};
  int lane_[kLanes];
  int count_ = 0;
};

}  // namespace stiction::inline STICTION_ISA
