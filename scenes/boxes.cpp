#include <vector>

#include "scenes/catalogue.hpp"
#include "scenes/rows.hpp"

// Stacks, walls and pyramids: boxes in courses, each resting on those of the course below it.

namespace stiction::scenes {
namespace {

/// An upright box in the layout's own axes.
struct Brick {
  Vec3 center, half;
};
using Course = std::vector<Brick>;

constexpr double kDensity = 500;    // [kg/m^3]
constexpr double kGapNoise = 1e-4;  // [m]

/// Range of x (or y) that two boxes share.
struct Overlap {
  double lo, hi;
};
Overlap overlap(double center_a, double half_a, double center_b, double half_b) {
  const double lo_a = center_a - half_a, lo_b = center_b - half_b;
  const double hi_a = center_a + half_a, hi_b = center_b + half_b;
  return {lo_a > lo_b ? lo_a : lo_b, hi_a < hi_b ? hi_a : hi_b};
}

class Masonry {
 public:
  Masonry(Rng& rng, const std::vector<Course>& courses) : rng_(rng), yaw_(rotation_z(rng.symmetric(3))) {
    bodies_of_.reserve(courses.size());
    for (const Course& course : courses) {
      std::vector<Index>& bodies = bodies_of_.emplace_back();
      for (const Brick& brick : course) bodies.push_back(add_body(brick));
    }
    for (std::size_t level = 0; level < courses.size(); ++level) {
      for (std::size_t i = 0; i < courses[level].size(); ++i) {
        const Brick& upper = courses[level][i];
        if (level == 0) {
          // The ground is a brick wide enough to lie under every corner.
          add_bed(kWorld, upper, bodies_of_[0][i], upper);
          continue;
        }
        for (std::size_t j = 0; j < courses[level - 1].size(); ++j) {
          add_bed(bodies_of_[level - 1][j], courses[level - 1][j], bodies_of_[level][i], upper);
        }
      }
    }
  }

  SceneEnv finish() && { return std::move(rows_).finish(); }

 private:
  Index add_body(const Brick& brick) {
    const double mass = kDensity * 8 * brick.half.x * brick.half.y * brick.half.z * rng_.uniform(0.8, 1.2);
    const Mat3 inertia = world_inertia(yaw_, box_inertia(mass, brick.half));
    const Vec3 velocity = random_vector(rng_, 0.02);
    return bodies_.add_free_body(mass, yaw_ * brick.center, inertia, velocity, random_vector(rng_, 0.1));
  }

  /// Contacts at the corners of the rectangle that two bricks share; none where they do not lie over each other.
  void add_bed(Index lower_body, const Brick& lower, Index upper_body, const Brick& upper) {
    const Overlap x = overlap(lower.center.x, lower.half.x, upper.center.x, upper.half.x);
    const Overlap y = overlap(lower.center.y, lower.half.y, upper.center.y, upper.half.y);
    if (x.lo >= x.hi || y.lo >= y.hi) return;
    const Index group = rows_.new_group();
    const double mu = rng_.uniform(0.3, 0.9);
    const double z = upper.center.z - upper.half.z;
    for (const Vec3 corner : {Vec3{x.lo, y.lo, z}, Vec3{x.hi, y.lo, z}, Vec3{x.hi, y.hi, z}, Vec3{x.lo, y.hi, z}}) {
      rows_.add_contact({lower_body, upper_body, yaw_ * corner, {0, 0, 1}, rng_.symmetric(kGapNoise), 0}, mu, group);
    }
  }

  Rng& rng_;
  Mat3 yaw_;
  Multibody bodies_;
  RowWriter rows_{bodies_};
  std::vector<std::vector<Index>> bodies_of_;
};

Brick jittered(Rng& rng, Brick brick, double offset) {
  brick.center.x += rng.symmetric(offset);
  brick.center.y += rng.symmetric(offset);
  return brick;
}

}  // namespace

SceneEnv make_stack(Rng& rng, int boxes) {
  constexpr double kHalf = 0.1;
  std::vector<Course> courses;
  for (int k = 0; k < boxes; ++k) {
    courses.push_back({jittered(rng, {{0, 0, (2 * k + 1) * kHalf}, {kHalf, kHalf, kHalf}}, 0.01)});
  }
  return Masonry(rng, courses).finish();
}

SceneEnv make_wall(Rng& rng, int courses) {
  constexpr double kJoint = 0.002;  // open head joints: neighbours in a course never touch [m]
  constexpr double kPitch = 0.2 + kJoint;
  constexpr Vec3 kWhole{0.1, 0.05, 0.035};
  constexpr Vec3 kHalfBrick{0.049, 0.05, 0.035};
  constexpr double kOffset = 5e-4;
  std::vector<Course> layout;
  for (int level = 0; level < courses; ++level) {
    const double z = (2 * level + 1) * kWhole.z;
    Course course;
    if (level % 2 == 0) {
      for (int i = 0; i < courses; ++i) course.push_back(jittered(rng, {{(i + 0.5) * kPitch, 0, z}, kWhole}, kOffset));
    } else {
      course.push_back(jittered(rng, {{0.25 * kPitch, 0, z}, kHalfBrick}, kOffset));
      for (int i = 1; i < courses; ++i) course.push_back(jittered(rng, {{i * kPitch, 0, z}, kWhole}, kOffset));
      course.push_back(jittered(rng, {{(courses - 0.25) * kPitch, 0, z}, kHalfBrick}, kOffset));
    }
    layout.push_back(std::move(course));
  }
  return Masonry(rng, layout).finish();
}

SceneEnv make_pyramid(Rng& rng, int levels) {
  constexpr double kHalf = 0.1;
  constexpr double kPitch = 0.22;
  std::vector<Course> courses;
  for (int level = 0; level < levels; ++level) {
    Course course;
    for (int i = 0; i < levels - level; ++i) {
      for (int j = 0; j < levels - level; ++j) {
        const Vec3 center{(i + 0.5 * level) * kPitch, (j + 0.5 * level) * kPitch, (2 * level + 1) * kHalf};
        course.push_back(jittered(rng, {center, {kHalf, kHalf, kHalf}}, 0.003));
      }
    }
    courses.push_back(std::move(course));
  }
  return Masonry(rng, courses).finish();
}

}  // namespace stiction::scenes
