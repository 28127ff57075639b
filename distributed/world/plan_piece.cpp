#include "distributed/world/plan_piece.hpp"

#include <span>

#include "core/plan/colored_body_plan.hpp"
#include "distributed/world/coloring.hpp"
#include "distributed/world/rounds.hpp"

namespace stiction::distributed {

template <class Real>
PiecePlan plan_piece(Transport& transport, const BodyBatchView<Real>& batch, const PieceBodies& bodies,
                     std::int64_t& waves) {
  PiecePlan made;
  made.plan = make_body_plan(batch, [&](std::span<const PushedBodies> vertices, std::span<Index> colors) {
    return color_over_ranks(transport, bodies, vertices, colors, waves);
  });
  made.rounds = make_rounds(transport, bodies, made.plan);
  return made;
}

template PiecePlan plan_piece(Transport&, const BodyBatchView<float>&, const PieceBodies&, std::int64_t&);
template PiecePlan plan_piece(Transport&, const BodyBatchView<double>&, const PieceBodies&, std::int64_t&);

}  // namespace stiction::distributed
