#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/base/fp_env.hpp"
#include "core/graph/slots.hpp"
#include "core/graph/svg_island.hpp"
#include "core/graph/svg_spectrum.hpp"
#include "core/graph/text.hpp"
#include "stiction/contact_graph.hpp"

namespace stiction {
namespace {

using graph::at;
using graph::IslandDrawing;
using graph::Point;
using graph::SvgText;

constexpr double kGap = 12;     // between boxes
constexpr double kEdge = 20;    // of the picture
constexpr double kTop = 70;     // under the title
constexpr double kLeast = 680;  // width that the legend and the spectrum need
constexpr Index kListedColors = 16;

/// Boxes on shelves, tall ones first, so that those of one shelf are about as tall as each other.
struct Shelves {
  std::vector<Point> corner;
  double right = 0, bottom = kTop;
};

Shelves shelve(const std::vector<IslandDrawing>& drawings) {
  double area = 0, widest = kLeast - 2 * kEdge;
  for (const IslandDrawing& drawing : drawings) {
    area += (drawing.size().x + kGap) * (drawing.size().y + kGap);
    widest = std::max(widest, drawing.size().x);
  }
  const double limit = kEdge + std::max(widest, 1.5 * std::sqrt(area));
  std::vector<std::size_t> order(drawings.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return drawings[a].size().y > drawings[b].size().y; });
  Shelves shelves;
  shelves.corner.resize(drawings.size());
  Point next{kEdge, kTop};
  for (const std::size_t i : order) {
    const Point size = drawings[i].size();
    if (next.x > kEdge && next.x + size.x > limit) next = {kEdge, shelves.bottom + kGap};
    shelves.corner[i] = next;
    shelves.right = std::max(shelves.right, next.x + size.x);
    shelves.bottom = std::max(shelves.bottom, next.y + size.y);
    next.x += size.x + kGap;
  }
  return shelves;
}

std::string summary(const GraphStatistics& s) {
  return graph::counted(s.moving_count, "body", "bodies") + ", " +
         graph::counted(s.contact_count, "contact", "contacts") + " of " +
         graph::counted(s.manifold_count, "pair", "pairs") + ", " +
         graph::counted(s.island_count, "island", "islands") + ", " +
         graph::counted(s.color_count, "colour", "colours") + "; density " + graph::fixed_text(s.density, 3) +
         ", degree " + std::to_string(s.min_degree) + " / " + graph::fixed_text(s.mean_degree, 1) + " / " +
         std::to_string(s.max_degree);
}

void draw_legend(SvgText& svg, Point corner, Point size, const ContactGraph& contacts) {
  svg.rect(corner, size, 8, "#ffffff", "#cfd4db");
  svg.text({corner.x + 12, corner.y + 19}, 12, "start", graph::kInk, "Colours, and how many pairs of each", true);
  std::vector<Offset> pairs(at(contacts.statistics().color_count), 0);
  for (const GraphManifold& m : contacts.manifolds()) ++pairs[at(m.color)];
  const auto listed = std::min(static_cast<Index>(pairs.size()), kListedColors);
  for (Index color = 0; color < listed; ++color) {
    const Index line = color / 4;
    const Point at_chip{corner.x + 12 + 66 * (color % 4), corner.y + 32 + 20 * line};
    svg.rect(at_chip, {14, 10}, 2, graph::color_hex(color), "none");
    svg.text({at_chip.x + 19, at_chip.y + 9}, 10, "start", graph::kInk,
             std::to_string(color) + ": " + std::to_string(pairs[at(color)]));
  }
  if (at(listed) < pairs.size())
    svg.text({corner.x + 12, corner.y + 122}, 10, "start", graph::kPale,
             "and " + std::to_string(pairs.size() - at(listed)) + " more colours");
  double x = corner.x + 12;
  for (const Index count : {1, 2, 4}) {
    const double y = corner.y + size.y - 56;
    svg.line({x + 2, y}, {x + 28, y}, "#9aa2ad", graph::edge_width(count));
    svg.text({x + 36, y + 3.5}, 10, "start", graph::kPale, count == 1 ? "1 contact" : std::to_string(count));
    x += count == 1 ? 94 : 56;
  }
  const Point foot{corner.x + 22, corner.y + size.y - 18};
  svg.line({foot.x, foot.y - 14}, foot, "#9aa2ad", graph::edge_width(1));
  graph::draw_hatching(svg, foot, {0, 1}, graph::kPale);
  svg.text({foot.x + 18, foot.y}, 10, "start", graph::kPale, "touches what never moves");
}

}  // namespace

std::string to_svg(const ContactGraph& graph, const std::string& title) {
  const ScopedFpEnv fp_env;
  const std::vector<graph::IslandEdges> islands = graph::edges_by_island(graph);
  const GraphStatistics stats = graph.statistics();
  const graph::DrawingScale scale = graph::scale_for(at(stats.largest_island));
  std::vector<IslandDrawing> drawings;
  for (const graph::IslandEdges& island : islands) drawings.emplace_back(island, scale);
  const Shelves shelves = shelve(drawings);

  SvgText svg;
  svg.text({kEdge, 32}, 17, "start", graph::kInk, title, true);
  svg.text({kEdge, 52}, 12, "start", graph::kPale, summary(stats));
  for (std::size_t i = 0; i < drawings.size(); ++i) drawings[i].draw(svg, shelves.corner[i]);
  const double width = std::max(shelves.right + kEdge, kLeast);
  const Point legend{kEdge, shelves.bottom + kGap}, legend_size{290, 200};
  draw_legend(svg, legend, legend_size, graph);
  const Point plot{legend.x + legend_size.x + kGap, legend.y};
  const Point plot_size{std::min(width - kEdge - plot.x, 640.0), legend_size.y};
  if (stats.largest_island <= kMaxSpectrumBodies) {
    graph::draw_spectrum(svg, plot, plot_size, laplacian_spectrum(graph), stats.island_count);
  } else {
    svg.text({plot.x, plot.y + 19}, 11, "start", graph::kPale,
             "No spectrum: an island has more than " + std::to_string(kMaxSpectrumBodies) + " bodies.");
  }
  return svg.document({width, legend.y + legend_size.y + kEdge}, title);
}

}  // namespace stiction
