#include "cli/features.hpp"

#include <span>

#include "cli/cone_graph.hpp"

namespace stiction::cli {

namespace {

std::size_t at(Offset i) {
  return static_cast<std::size_t>(i);
}

void widen(std::optional<Range>& range, double value) {
  if (!range) range = Range{value, value};
  if (value < range->min) range->min = value;
  if (value > range->max) range->max = value;
}

void count_cones(const ContactBatchView<double>& batch, Features& features) {
  for (Offset cone = 0; cone < batch.cone_count; ++cone) {
    const Offset first = batch.cone_row_offsets[cone];
    const Offset last = batch.cone_row_offsets[cone + 1];
    switch (batch.cone_kind[cone]) {
      case ConeKind::free:
        ++features.free;
        break;
      case ConeKind::unilateral:
        ++features.unilateral;
        break;
      case ConeKind::box:
        ++features.box;
        break;
      case ConeKind::friction:
      case ConeKind::box_friction:
        ++(batch.cone_kind[cone] == ConeKind::friction ? features.friction : features.box_friction)[at(last - first)];
        for (Offset row = first + 1; row < last; ++row) widen(features.friction_coefficient, batch.mu[row]);
        break;
      case ConeKind::semidefinite:
        ++features.semidefinite[at(last - first)];
        break;
    }
  }
}

void measure_plan(const PlanData& plan, Features& features) {
  for (std::size_t env = 0; env < plan.path.size(); ++env) {
    ++features.paths[static_cast<std::size_t>(plan.path[env])];
    if (plan.path[env] != EnvPath::sparse) continue;
    features.vertices.push_back(plan.env_vertex_offsets[env + 1] - plan.env_vertex_offsets[env] - 1);
    features.colors.push_back(plan.color_count[env]);
  }
}

void measure_operators(const ContactBatchView<double>& batch, Features& features) {
  const Offset sample = batch.env_count < kOperatorSample ? batch.env_count : kOperatorSample;
  std::vector<Offset> envs;
  for (Offset i = 0; i < sample; ++i) envs.push_back(i * batch.env_count / sample);
  AnalysisOptions options;
  options.max_steps = kOperatorSteps;
  features.operators = analyse(batch, std::span<const Offset>(envs), options);
  std::erase_if(features.operators, [](const OperatorAnalysis& seen) { return seen.rows == 0 || !seen.is_finite; });
}

}  // namespace

Features measure(const ContactBatchView<double>& batch, const PlanData& plan) {
  Features features;
  for (Offset env = 0; env < batch.env_count; ++env) {
    const Offset first = batch.env_row_offsets[env];
    const Offset last = batch.env_row_offsets[env + 1];
    const Offset nonzeros = batch.row_offsets[last] - batch.row_offsets[first];
    features.rows.push_back(last - first);
    features.cones.push_back(batch.env_cone_offsets[env + 1] - batch.env_cone_offsets[env]);
    features.nonzeros.push_back(nonzeros);
    if (last > first) {
      const auto n = static_cast<double>(last - first);
      features.density.push_back(static_cast<double>(nonzeros) / (n * n));
    }
    features.islands.push_back(make_cone_graph(batch, env).island_count);
  }
  count_cones(batch, features);
  measure_plan(plan, features);
  features.asymmetry = asymmetry(batch);
  for (Offset row = 0; row < batch.row_count; ++row) widen(features.compliance, batch.R[row]);
  measure_operators(batch, features);
  return features;
}

}  // namespace stiction::cli
