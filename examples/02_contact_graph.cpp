// A wall of bricks cracks open: its contact graph is kept from step to step and drawn at the end.
//     02_contact_graph [NAME]      writes NAME.dot and NAME.svg (contact_graph)
#include <cstdio>
#include <exception>
#include <fstream>
#include <string>
#include <vector>

#include "stiction/stiction.hpp"

namespace {

using stiction::GraphContact;
using stiction::Index;

constexpr int kRows = 5, kColumns = 7, kSteps = 8;

struct Brick {
  double left;  // in brick lengths
  int row;
};

/// Running bond, every other row half a brick to the right; a pile of three and a loose brick stand apart.
std::vector<Brick> build_wall() {
  std::vector<Brick> bricks;
  for (int row = 0; row < kRows; ++row) {
    for (int column = 0; column < kColumns; ++column) bricks.push_back({column + 0.5 * (row % 2), row});
  }
  for (int row = 0; row < 3; ++row) bricks.push_back({20, row});
  bricks.push_back({30, 4});
  return bricks;
}

/// Bricks right of the crack, a staircase from the lower left to the upper right, lean away: the top goes fastest.
void open_crack(std::vector<Brick>& bricks) {
  for (int k = 0; k < kRows * kColumns; ++k) {
    Brick& brick = bricks[static_cast<std::size_t>(k)];
    if (k % kColumns >= 2 + brick.row / 2) brick.left += 0.02 * (brick.row + 4);
  }
}

/// Faces that touch have two contacts, one at each end. Their ids are made of the pair, so they stay across steps.
void add_face(std::vector<GraphContact>& contacts, Index a, Index b) {
  const auto pair = static_cast<std::uint64_t>(a + 1) << 32 | static_cast<std::uint64_t>(b + 1) << 1;
  contacts.push_back({pair, a, b});
  contacts.push_back({pair | 1, a, b});
}

std::vector<GraphContact> touching(const std::vector<Brick>& bricks) {
  std::vector<GraphContact> contacts;
  for (Index a = 0; a < static_cast<Index>(bricks.size()); ++a) {
    const Brick& lower = bricks[static_cast<std::size_t>(a)];
    if (lower.row == 0) add_face(contacts, stiction::kWorldBody, a);
    for (Index b = 0; b < static_cast<Index>(bricks.size()); ++b) {
      const Brick& other = bricks[static_cast<std::size_t>(b)];
      const double shift = other.left - lower.left;
      const bool rests = other.row == lower.row + 1 && shift > -0.99 && shift < 0.99;
      const bool beside = other.row == lower.row && shift > 0.99 && shift < 1.01;
      if (rests || beside) add_face(contacts, a, b);
    }
  }
  return contacts;
}

void write(const std::string& path, const std::string& text) {
  std::ofstream file(path);
  file << text;
  file.close();
  if (!file) throw stiction::Error(stiction::ErrorCode::io, path + ": could not be written");
}

void run(const std::string& name) {
  std::vector<Brick> bricks = build_wall();
  stiction::ContactGraph graph;
  for (Index brick = 0; brick < static_cast<Index>(bricks.size()); ++brick) graph.add_body(brick);
  for (int step = 0; step < kSteps; ++step) {
    const stiction::GraphChange change = graph.update(touching(bricks));
    const stiction::GraphStatistics stats = graph.statistics();
    std::printf("step %d: +%lld -%lld =%lld contacts, %lld of %lld pairs looked at, %lld islands, %d colours\n", step,
                static_cast<long long>(change.added), static_cast<long long>(change.removed),
                static_cast<long long>(change.kept), static_cast<long long>(change.evaluated_manifolds),
                static_cast<long long>(stats.manifold_count), static_cast<long long>(stats.island_count),
                stats.color_count);
    open_crack(bricks);
  }
  write(name + ".dot", stiction::to_dot(graph, "a cracked wall"));
  write(name + ".svg", stiction::to_svg(graph, "A cracked wall, a pile and a loose brick"));
}

}  // namespace

int main(int argc, char** argv) {
  try {
    run(argc > 1 ? argv[1] : "contact_graph");
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
