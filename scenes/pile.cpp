#include <vector>

#include "scenes/catalogue.hpp"
#include "scenes/rows.hpp"

// Spheres poured into a square bin. The settling moves positions only (gravity step, then overlaps pushed apart pair
// by pair in a fixed order). The environment holds the instant after it, with contacts for every pair that overlaps or
// nearly touches.

namespace stiction::scenes {
namespace {

constexpr double kMeanRadius = 0.05;      // [m]
constexpr double kDensity = 1000;         // [kg/m^3]
constexpr double kTouching = 1e-3;        // pairs nearer than this have a contact [m]
constexpr double kOpen = 1e9;             // the bin has no lid [m]
constexpr double kSettledOverlap = 2e-4;  // [m]
constexpr int kFallStepsPerLayer = 8;     // of a tenth of a radius: a third of the lattice's height
constexpr int kSettleSteps = 100;         // of a two-hundredth: into the gaps, with little overlap
constexpr int kRelaxSteps = 300, kPairRefresh = 10;

struct Ball {
  Vec3 center;
  double radius;
};

struct Pair {
  std::size_t a, b;
};

/// Overlaps left by the settling count as touching. Asked to recover them, spheres jammed between opposite walls
/// could have no solution at all; with no positive target, standing still is always feasible.
double not_overlapping(double gap) {
  return gap > 0 ? gap : 0;
}

class Bin {
 public:
  Bin(Rng& rng, int spheres) {
    int side = 1;
    while (side * side * side < spheres) ++side;
    half_width_ = 1.25 * kMeanRadius * side;
    const double pitch = 2 * half_width_ / side;
    for (int k = 0; k < spheres; ++k) {
      const double radius = kMeanRadius * rng.uniform(0.8, 1.2);
      const int layer = k / (side * side);
      const Vec3 cell{(k % side + 0.5) * pitch - half_width_, (k / side % side + 0.5) * pitch - half_width_,
                      (layer + 0.6) * 2.5 * kMeanRadius};
      balls.push_back({cell + random_vector(rng, 0.3 * kMeanRadius), radius});
    }
    const int fall_steps = kFallStepsPerLayer * side;
    const int gravity_steps = fall_steps + kSettleSteps;
    for (int step = 0; step < gravity_steps + kRelaxSteps; ++step) {
      if (step % kPairRefresh == 0) pairs_ = pairs_within(0.5 * kMeanRadius);
      if (step < gravity_steps) {
        const double fall = (step < fall_steps ? 0.1 : 0.005) * kMeanRadius;
        for (Ball& ball : balls) ball.center.z -= fall;
      }
      const double overlap = push_apart();
      if (step >= gravity_steps && overlap < kSettledOverlap) break;
    }
  }

  [[nodiscard]] double half_width() const { return half_width_; }

  /// Pairs whose surfaces are nearer than `gap`, in lexicographic order.
  [[nodiscard]] std::vector<Pair> pairs_within(double gap) const {
    std::vector<Pair> pairs;
    for (std::size_t a = 0; a < balls.size(); ++a) {
      for (std::size_t b = a + 1; b < balls.size(); ++b) {
        const double reach = balls[a].radius + balls[b].radius + gap;
        const Vec3 d = balls[b].center - balls[a].center;
        if (dot(d, d) < reach * reach) pairs.push_back({a, b});
      }
    }
    return pairs;
  }

  std::vector<Ball> balls;

 private:
  /// Moves a coordinate into [lo, hi]; the larger of `largest` and the distance it moved.
  static double push_into(double& coordinate, double lo, double hi, double largest) {
    const double before = coordinate;
    if (coordinate > hi) coordinate = hi;
    if (coordinate < lo) coordinate = lo;
    const double moved = coordinate > before ? coordinate - before : before - coordinate;
    return moved > largest ? moved : largest;
  }

  /// One pass over pairs, ground and walls; the largest overlap it met [m].
  double push_apart() {
    double largest = 0;
    for (const Pair& pair : pairs_) {
      Ball& a = balls[pair.a];
      Ball& b = balls[pair.b];
      const Vec3 d = b.center - a.center;
      const double reach = a.radius + b.radius;
      const double distance2 = dot(d, d);
      if (distance2 >= reach * reach || distance2 == 0) continue;
      const double distance = std::sqrt(distance2);
      const double overlap = reach - distance;
      if (overlap > largest) largest = overlap;
      const Vec3 push = (0.5 * overlap / distance) * d;
      a.center = a.center - push;
      b.center = b.center + push;
    }
    for (Ball& ball : balls) {
      largest = push_into(ball.center.z, ball.radius, kOpen, largest);
      const double room = half_width_ - ball.radius;
      for (double* c : {&ball.center.x, &ball.center.y}) {
        largest = push_into(*c, -room, room, largest);
      }
    }
    return largest;
  }

  double half_width_ = 0;
  std::vector<Pair> pairs_;
};

}  // namespace

SceneEnv make_pile(Rng& rng, int spheres) {
  const Bin bin(rng, spheres);
  Multibody bodies;
  std::vector<Index> body_of;
  for (const Ball& ball : bin.balls) {
    const double mass = kDensity * 4.1887902047863905 * ball.radius * ball.radius * ball.radius;
    const Mat3 inertia = world_inertia({}, sphere_inertia(mass, ball.radius));
    const Vec3 velocity = random_vector(rng, 0.05);
    body_of.push_back(bodies.add_free_body(mass, ball.center, inertia, velocity, random_vector(rng, 1)));
  }

  RowWriter rows(bodies);
  const double mu = rng.uniform(0.2, 0.9);
  for (std::size_t k = 0; k < bin.balls.size(); ++k) {
    const Ball& ball = bin.balls[k];
    const Vec3 c = ball.center;
    const double wall = bin.half_width();
    struct Plane {
      Vec3 normal;
      double distance;
    };
    for (const Plane& plane : {Plane{{0, 0, 1}, c.z}, Plane{{1, 0, 0}, wall + c.x}, Plane{{-1, 0, 0}, wall - c.x},
                               Plane{{0, 1, 0}, wall + c.y}, Plane{{0, -1, 0}, wall - c.y}}) {
      const double gap = not_overlapping(plane.distance - ball.radius);
      if (gap >= kTouching) continue;
      rows.add_contact({kWorld, body_of[k], c - plane.distance * plane.normal, plane.normal, gap, 0}, mu,
                       rows.new_group());
    }
  }
  for (const Pair& pair : bin.pairs_within(kTouching)) {
    const Ball& a = bin.balls[pair.a];
    const Ball& b = bin.balls[pair.b];
    const Vec3 d = b.center - a.center;
    const double distance = norm(d);
    const Vec3 normal = (1 / distance) * d;
    const double gap = not_overlapping(distance - (a.radius + b.radius));
    rows.add_contact({body_of[pair.a], body_of[pair.b], a.center + (a.radius + 0.5 * gap) * normal, normal, gap, 0}, mu,
                     rows.new_group());
  }
  return std::move(rows).finish();
}

}  // namespace stiction::scenes
