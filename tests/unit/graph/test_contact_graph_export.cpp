#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <string>
#include <vector>

#include "stiction/contact_graph.hpp"
#include "stiction/error.hpp"

namespace {

using namespace stiction;

/// Edges between bodies first..first+n-1, each of `weight` contacts, added to a graph.
void add_edges(ContactGraph& graph, const std::vector<std::pair<Index, Index>>& edges, Index weight = 1) {
  for (const auto& [a, b] : edges) {
    for (Index k = 0; k < weight; ++k)
      graph.add_contact({static_cast<std::uint64_t>(graph.statistics().contact_count), a, b});
  }
}

void add_bodies(ContactGraph& graph, Index first, Index count) {
  for (Index body = first; body < first + count; ++body) graph.add_body(body);
}

ContactGraph path(Index n, Index weight) {
  ContactGraph graph;
  add_bodies(graph, 0, n);
  for (Index body = 0; body + 1 < n; ++body) add_edges(graph, {{body, body + 1}}, weight);
  return graph;
}

ContactGraph complete(Index n) {
  ContactGraph graph;
  add_bodies(graph, 0, n);
  for (Index a = 0; a < n; ++a) {
    for (Index b = a + 1; b < n; ++b) add_edges(graph, {{a, b}});
  }
  return graph;
}

/// Two triangles of which one touches the world twice, a fixed body at both, and a body that touches nothing.
ContactGraph mixed() {
  ContactGraph graph;
  add_bodies(graph, 0, 7);
  graph.add_body(9, BodyRole::fixed);
  add_edges(graph, {{0, 1}, {1, 2}, {2, 0}}, 3);
  add_edges(graph, {{3, 4}, {4, 5}, {5, 3}, {9, 2}, {9, 3}});
  add_edges(graph, {{kWorldBody, 0}}, 2);
  return graph;
}

/// Backward stable: a few roundings of the largest eigenvalue for each of n steps.
void expect_spectrum(const ContactGraph& graph, std::vector<double> expected) {
  const std::vector<double> spectrum = laplacian_spectrum(graph);
  std::sort(expected.begin(), expected.end());
  ASSERT_EQ(spectrum.size(), expected.size());
  const double tolerance = 1e-15 * static_cast<double>(expected.size()) * (1 + expected.back());
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(spectrum[i], expected[i], tolerance) << i;
}

TEST(LaplacianSpectrum, OfAPathIsKnown) {
  for (const Index n : {1, 2, 3, 10, 64}) {
    std::vector<double> expected;
    for (Index k = 0; k < n; ++k) expected.push_back(3 * (2 - 2 * std::cos(k * std::numbers::pi / n)));
    expect_spectrum(path(n, 3), expected);
  }
}

TEST(LaplacianSpectrum, OfACompleteGraphIsOneZeroAndTheNumberOfBodies) {
  for (const Index n : {3, 8, 25}) {
    std::vector<double> expected(static_cast<std::size_t>(n), n);
    expected[0] = 0;
    expect_spectrum(complete(n), expected);
  }
}

TEST(LaplacianSpectrum, OfAGridIsTheSumsOfTwoPaths) {
  constexpr Index kWide = 7, kHigh = 5;
  ContactGraph grid;
  add_bodies(grid, 0, kWide * kHigh);
  std::vector<double> expected;
  for (Index y = 0; y < kHigh; ++y) {
    for (Index x = 0; x < kWide; ++x) {
      if (x + 1 < kWide) add_edges(grid, {{y * kWide + x, y * kWide + x + 1}});
      if (y + 1 < kHigh) add_edges(grid, {{y * kWide + x, y * kWide + x + kWide}});
      expected.push_back(4 - 2 * std::cos(x * std::numbers::pi / kWide) - 2 * std::cos(y * std::numbers::pi / kHigh));
    }
  }
  expect_spectrum(grid, expected);
}

// Triangles of weight 3 and 1: 0, 9, 9 and 0, 3, 3. Contacts with fixed bodies have no part.
TEST(LaplacianSpectrum, HasAZeroForEveryIsland) {
  expect_spectrum(mixed(), {0, 0, 0, 3, 3, 9, 9});
  EXPECT_TRUE(laplacian_spectrum(ContactGraph()).empty());
}

TEST(LaplacianSpectrum, IsRefusedForAnIslandThatIsTooLarge) {
  ContactGraph graph = path(kMaxSpectrumBodies + 1, 1);
  try {
    laplacian_spectrum(graph);
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::unsupported);
    EXPECT_NE(std::string(error.what()).find("513 bodies"), std::string::npos) << error.what();
  }
  EXPECT_NE(to_svg(graph).find("No spectrum"), std::string::npos);
}

std::size_t times(const std::string& text, const std::string& word) {
  std::size_t count = 0;
  for (std::size_t at = text.find(word); at != std::string::npos; at = text.find(word, at + 1)) ++count;
  return count;
}

/// Why a text is not well-formed XML as far as tags, quotes and entities go; empty: it is.
std::string xml_fault(const std::string& text) {
  std::vector<std::string> open;
  std::size_t at = 0, roots = 0;
  const auto bad_entity = [&](std::size_t amp) {
    for (const char* entity : {"&amp;", "&lt;", "&gt;", "&quot;"}) {
      if (text.compare(amp, std::char_traits<char>::length(entity), entity) == 0) return false;
    }
    return true;
  };
  while (at < text.size()) {
    if (text[at] == '&' && bad_entity(at)) return "entity at " + std::to_string(at);
    if (text[at] != '<') {
      if (open.empty() && text[at] != '\n') return "text outside at " + std::to_string(at);
      ++at;
      continue;
    }
    std::size_t end = at + 1;
    for (bool quoted = false; end < text.size() && (quoted || text[end] != '>'); ++end) {
      if (text[end] == '"') quoted = !quoted;
      if (text[end] == '<') return "< in a tag at " + std::to_string(end);
      if (text[end] == '&' && bad_entity(end)) return "entity at " + std::to_string(end);
    }
    if (end == text.size()) return "tag not closed at " + std::to_string(at);
    const std::string tag = text.substr(at + 1, end - at - 1);
    at = end + 1;
    if (tag.front() == '?') continue;
    const std::string name = tag.substr(0, tag.find_first_of(" /", 1));
    if (tag.front() == '/') {
      if (open.empty() || "/" + open.back() != name) return "closes " + name;
      open.pop_back();
    } else if (tag.back() != '/') {
      roots += open.empty() ? 1 : 0;
      open.push_back(name);
    }
  }
  if (!open.empty()) return open.back() + " stays open";
  return roots == 1 ? "" : std::to_string(roots) + " roots";
}

TEST(GraphSvg, IsWellFormedAndShowsEveryBodyEdgeAndIsland) {
  for (const ContactGraph& graph : {ContactGraph(), path(1, 1), path(30, 2), path(700, 1), complete(20), mixed()}) {
    const std::string svg = to_svg(graph, "a \"b\" <c> & \x01 d");
    EXPECT_EQ(xml_fault(svg), "");
    EXPECT_EQ(svg.find("nan"), std::string::npos);
    EXPECT_EQ(svg.find("inf"), std::string::npos);
    const GraphStatistics stats = graph.statistics();
    EXPECT_EQ(times(svg, "<title>body "), static_cast<std::size_t>(stats.moving_count));
    EXPECT_EQ(times(svg, ">island "), static_cast<std::size_t>(stats.island_count));
    EXPECT_EQ(times(svg, ", colour "), static_cast<std::size_t>(stats.manifold_count));
    EXPECT_EQ(svg, to_svg(graph, "a \"b\" <c> & \x01 d")) << "the same graph, the same text";
  }
  EXPECT_EQ(xml_fault("<a><b></a></b>"), "closes /a") << "the checker can fail";
}

/// Centres of the circles of bodies, in order.
std::vector<std::pair<double, double>> centres(const std::string& svg) {
  std::vector<std::pair<double, double>> found;
  for (std::size_t at = svg.find("<title>body "); at != std::string::npos; at = svg.find("<title>body ", at + 1)) {
    const std::size_t circle = svg.find("<circle", at);
    double x = 0, y = 0;
    EXPECT_EQ(std::sscanf(svg.c_str() + circle, "<circle cx=\"%lf\" cy=\"%lf\"", &x, &y), 2);
    found.emplace_back(x, y);
  }
  return found;
}

TEST(GraphSvg, KeepsBodiesApartAndDrawsAPathStraight) {
  for (const ContactGraph& graph : {path(40, 1), complete(12), mixed(), path(600, 1)}) {
    const auto points = centres(to_svg(graph));
    ASSERT_EQ(points.size(), static_cast<std::size_t>(graph.statistics().moving_count));
    double nearest = 1e9;
    for (std::size_t i = 0; i < points.size(); ++i) {
      for (std::size_t j = 0; j < i; ++j)
        nearest = std::min(nearest, std::hypot(points[i].first - points[j].first, points[i].second - points[j].second));
    }
    EXPECT_GT(nearest, 8) << points.size() << " bodies";
  }
  const auto line = centres(to_svg(path(20, 1)));
  for (std::size_t i = 1; i < line.size(); ++i) {
    EXPECT_NEAR(line[i].first - line[i - 1].first, 60, 3) << "left to right";
    EXPECT_NEAR(line[i].second, line[0].second, 3);
  }
}

TEST(GraphDot, BoxesIslandsAndLabelsEdgesWithTheirContacts) {
  const std::string dot = to_dot(mixed());
  EXPECT_EQ(times(dot, "subgraph cluster_"), 3U);
  EXPECT_EQ(times(dot, " -- "), 9U);
  EXPECT_EQ(times(dot, "weight=3 "), 3U);
  EXPECT_NE(dot.find("label=\"island 0: 3 bodies, 12 contacts\""), std::string::npos) << dot;
  EXPECT_NE(dot.find("0 -- \"world at 0\" [label=\"2\""), std::string::npos) << dot;
  EXPECT_NE(dot.find("3 -- \"9 at 3\" [label=\"1\""), std::string::npos) << dot;
}

TEST(GraphDot, IsAcceptedByGraphviz) {
  if (std::system("dot -V > /dev/null 2>&1") != 0) GTEST_SKIP() << "no dot (Debian: graphviz): syntax not checked";
  const auto file = std::filesystem::temp_directory_path() / "stiction_test_contact_graph.dot";
  const auto accepts = [&](const std::string& dot) {
    std::ofstream(file) << dot;
    return std::system(("dot -Tcanon \"" + file.string() + "\" > /dev/null 2>&1").c_str()) == 0;
  };
  EXPECT_TRUE(accepts(to_dot(mixed(), "a \"quoted\" \\ title")));
  EXPECT_TRUE(accepts(to_dot(ContactGraph())));
  EXPECT_FALSE(accepts("graph {")) << "the check can fail";
  std::filesystem::remove(file);
}

}  // namespace
