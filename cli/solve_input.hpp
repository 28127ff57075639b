#pragma once

#include <fmt/format.h>

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cli/convert_values.hpp"
#include "cli/load.hpp"
#include "cli/permute.hpp"
#include "cli/report.hpp"
#include "cli/shard.hpp"
#include "cli/solve_options.hpp"
#include "stiction/error.hpp"
#include "stiction/io.hpp"
#include "stiction/pyramid.hpp"

/// Input of `stiction solve`, and the part of it that is solved.
namespace stiction::cli {

/// A batch and a warm start in the precision and the order they are solved in.
template <class Real>
struct Work {
  ContactBatch<Real> batch;
  std::vector<Real> warm_start;  ///< empty: none
};

template <class Real>
Work<Real> prepare(const ContactBatch<double>& batch, const std::vector<double>& warm_start,
                   std::span<const Offset> order) {
  Work<Real> work{convert<Real>(batch), convert_values<Real>(warm_start)};
  if (!order.empty()) {
    work.batch = gather(work.batch, order);
    if (!warm_start.empty()) {
      work.warm_start = gather_rows(std::span<const Real>(work.warm_start),
                                    std::span<const Offset>(batch.arrays().env_row_offsets), order);
    }
  }
  return work;
}

/// J and M in the order of solving. `own` are the environments of a shard, which may have none.
template <class Real>
JacobianBatch<Real> jacobians_of(const std::string& file, const io::Recording& recording, std::vector<Offset> order,
                                 const std::optional<std::vector<Offset>>& own) {
  if (own && own->empty()) return JacobianBatch<Real>();
  if (own && order.empty())
    order = *own;
  else if (own)
    for (Offset& env : order) env = (*own)[static_cast<std::size_t>(env)];
  try {
    return io::jacobian_batch<Real>(recording, order);
  } catch (const Error& error) {
    throw Error(ErrorCode::bad_file, fmt::format("{}: {}", file, error.what()));
  }
}

/// A file's environments, or a shard's, and the problem solved for them.
template <class Real>
struct SolveInput {
  LoadedBatch loaded;
  std::optional<ContactBatch<double>> part;      ///< a shard's environments
  std::optional<PyramidBatch<double>> pyramids;  ///< problem solved in place of friction cones
  std::vector<double> warm_start;                ///< of file_batch(); empty: none
  std::vector<Offset> order;                     ///< environments as they are solved; empty: in the file's order
  Work<Real> work;
  JacobianBatch<Real> jacobians;  ///< where J and M are solved

  /// The environments in the file's order, with the file's cones.
  [[nodiscard]] const ContactBatch<double>& file_batch() const { return part ? *part : loaded.recording.batch; }
  /// These environments as they are solved: pyramids have cones of their own.
  [[nodiscard]] const ContactBatch<double>& batch() const { return pyramids ? pyramids->batch : file_batch(); }
};

/// Reads the file and makes the problem to solve. Describes it in the report.
template <class Real>
SolveInput<Real> load_input(const SolveArguments& arguments, SolveReport& report) {
  const auto policy = arguments.isolate ? ValueDefects::keep : ValueDefects::refuse;
  SolveInput<Real> input;
  input.loaded = load_batch(arguments.batch, law_from_option(arguments.law), policy, report.options.solver);
  const ContactBatch<double>& whole = input.loaded.recording.batch;
  if (arguments.warm_start) input.warm_start = load_solution(*arguments.warm_start, whole).lambda;
  report.law = whole.law();
  std::optional<std::vector<Offset>> own;  // the shard's environments
  if (report.shard) {
    own = describe_shard(arguments, input.warm_start, whole.env_count(), report, *report.shard);
    if (!input.warm_start.empty())
      input.warm_start = gather_rows(std::span<const double>(input.warm_start),
                                     std::span<const Offset>(whole.arrays().env_row_offsets), *own);
    input.part = gather(whole, std::span<const Offset>(*own));
  }
  if (arguments.pyramid > 0) input.pyramids = linearise(input.file_batch(), arguments.pyramid);
  const ContactBatch<double>& batch = input.batch();
  if (arguments.permute) input.order = random_order(batch.env_count(), *arguments.permute);
  input.work = prepare<Real>(batch, input.warm_start, input.order);
  if (takes_jacobian(arguments))
    input.jacobians = jacobians_of<Real>(report.file, input.loaded.recording, input.order, own);
  report.environments = batch.env_count();
  report.rows = input.file_batch().row_count();
  report.cones = input.file_batch().view().cone_count;
  report.law = batch.law();
  return input;
}

}  // namespace stiction::cli
