#pragma once

#include "core/base/real.hpp"
#include "core/job/world_job.hpp"

/// Numbers of pairs of shapes. All pairs of shapes of different bodies are in order of (body_a, body_b, shape_a,
/// shape_b); a pair's number is its place there. It follows from the shapes, so no list of all pairs is needed.
namespace stiction::inline STICTION_ISA {

template <class Real>
STICTION_HD const BodyShapes& shapes_of_body(const WorldModelView<Real>& model, Index body) {
  return model.shapes_of[body + 1];
}

template <class Real>
STICTION_HD ShapePair shape_pair(const WorldModelView<Real>& model, Index a, Index b) {
  return {a, b, model.shape[a].body, model.shape[b].body};
}

/// Before a pair come those of lower bodies before its own. Then those of its lower body with the bodies between the
/// two: as many shapes of the one as of the others, each with each. Then those of its two bodies.
template <class Real>
STICTION_HD Offset pair_number(const WorldModelView<Real>& model, const ShapePair& pair) {
  const BodyShapes& a = shapes_of_body(model, pair.body_a);
  const BodyShapes& b = shapes_of_body(model, pair.body_b);
  return a.pairs_before + Offset{a.end - a.begin} * (b.begin - a.end) +
         Offset{pair.shape_a - a.begin} * (b.end - b.begin) + (pair.shape_b - b.begin);
}

/// Counts the pairs: all that come before the last body, which shares none with a later one.
template <class Real>
STICTION_HD Offset pair_count(const WorldModelView<Real>& model) {
  return shapes_of_body(model, model.bodies - 1).pairs_before;
}

/// The pair that has that number, which is below pair_count().
template <class Real>
STICTION_HD ShapePair numbered_pair(const WorldModelView<Real>& model, Offset number) {
  // The last body that no more pairs come before. It has pairs, since those without any share the next one's number.
  Index low = -1;
  Index high = model.bodies;
  while (high - low > 1) {
    const Index middle = low + (high - low) / 2;
    if (shapes_of_body(model, middle).pairs_before <= number) {
      low = middle;
    } else {
      high = middle;
    }
  }
  const BodyShapes& a = shapes_of_body(model, low);
  const Index count_a = a.end - a.begin;
  const Offset in_body = number - a.pairs_before;
  // Every shape of later bodies has count_a pairs with this one, so this is some shape of the other body.
  const Index other = model.shape[a.end + static_cast<Index>(in_body / count_a)].body;
  const BodyShapes& b = shapes_of_body(model, other);
  const Offset in_pair = in_body - Offset{count_a} * (b.begin - a.end);
  const Index count_b = b.end - b.begin;
  return {a.begin + static_cast<Index>(in_pair / count_b), b.begin + static_cast<Index>(in_pair % count_b), low, other};
}

/// Friction is the square root of the product of the two, restitution the larger of the two.
template <class Real>
STICTION_HD WorldPair<Real> with_surfaces(const WorldModelView<Real>& model, const ShapePair& pair) {
  const WorldShapeData<Real>& a = model.shape[pair.shape_a];
  const WorldShapeData<Real>& b = model.shape[pair.shape_b];
  return {pair, narrowed<Real>(sqrt_(a.mu * b.mu)),
          narrowed<Real>(a.restitution < b.restitution ? b.restitution : a.restitution)};
}

/// The pair that has that number, from the list where there is one.
template <class Real>
STICTION_HD WorldPair<Real> world_pair(const WorldModelView<Real>& model, Offset number) {
  return model.by_tree ? with_surfaces(model, numbered_pair(model, number)) : model.pair[number];
}

}  // namespace stiction::inline STICTION_ISA
