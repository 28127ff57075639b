#include <fmt/format.h>

#include <algorithm>
#include <cstdio>

#include "cli/commands.hpp"
#include "cli/cone_graph.hpp"
#include "cli/features.hpp"
#include "cli/graphviz.hpp"
#include "cli/inspect_report.hpp"
#include "cli/load.hpp"
#include "cli/output.hpp"
#include "cli/progress.hpp"
#include "stiction/error.hpp"

namespace stiction::cli {

namespace {

/// A picture of more cones is hard to read.
constexpr Offset kReadableCones = 200;

/// The environment a picture shows if the caller names none. It is the first with the most cones that are still
/// readable, else the first with the fewest. -1: no environment has cones.
Offset picture_env(const Features& features) {
  Offset best = -1;
  Offset best_cones = 0;
  for (std::size_t env = 0; env < features.cones.size(); ++env) {
    const Offset cones = features.cones[env];
    if (cones == 0) continue;
    const bool readable = cones <= kReadableCones;
    const bool best_readable = best_cones <= kReadableCones;
    const bool better = readable == best_readable ? (readable ? cones > best_cones : cones < best_cones) : readable;
    if (best < 0 || better) {
      best = static_cast<Offset>(env);
      best_cones = cones;
    }
  }
  return best;
}

void draw(const std::filesystem::path& path, const ContactBatchView<double>& batch, const PlanData& plan, Offset env,
          const std::string& title_start) {
  const ConeGraph graph = make_cone_graph(batch, env);
  const std::vector<Index> colors = cone_colors(graph, batch, plan, env);
  const Index color_count = *std::max_element(colors.begin(), colors.end()) + 1;
  const std::string title = fmt::format("{}: {} cones, {} couplings, {} islands, {} colours", title_start,
                                        graph.cone_count(), graph.edge_count(), graph.island_count, color_count);
  write_graph(path, to_dot(graph, batch, env, colors, title), graph.island_count > 1);
}

}  // namespace

int run_inspect(const InspectArguments& arguments) {
  if (arguments.graph) {
    require_different(arguments.batch, *arguments.graph);
    require_graph_path(*arguments.graph);
  }
  Progress progress("loading", 0, false);
  LoadedBatch loaded = load_batch(arguments.batch, std::nullopt, ValueDefects::keep);
  ContactBatch<double>& batch = loaded.recording.batch;
  if (arguments.environment) {
    require_environment(*arguments.environment, batch.env_count());
    const std::vector<Offset> only{*arguments.environment};
    batch = gather(batch, std::span<const Offset>(only));
    std::erase_if(loaded.defects, [&](const Defect& defect) { return defect.env != only.front(); });
  }
  progress.relabel("measuring");
  const PlanData plan = make_plan(batch.view());
  InspectReport report;
  report.file = arguments.batch.string();
  report.environment = arguments.environment;
  report.kind = io::detect(arguments.batch);
  report.source = loaded.recording.source;
  report.law = batch.law();
  report.features = measure(batch.view(), plan);
  report.has_jacobian = !loaded.recording.J.ptr.empty();
  report.has_reference = !loaded.recording.lambda_ref.empty();
  report.warnings = warnings(report.features, loaded.defects);

  if (arguments.graph) {
    progress.relabel("drawing");
    const Offset env = picture_env(report.features);
    if (env < 0) {
      throw Error(ErrorCode::invalid_argument, fmt::format("{}: there are no cones to draw", arguments.batch.string()));
    }
    report.graph_environment = arguments.environment.value_or(env);
    draw(*arguments.graph, batch.view(), plan, env,
         fmt::format("{}, environment {}", arguments.batch.filename().string(), *report.graph_environment));
  }
  write_text("-", arguments.json ? to_json(report) : to_text(report));
  return kExitDone;
}

}  // namespace stiction::cli
