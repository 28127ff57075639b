#pragma once

#include <algorithm>
#include <random>
#include <utility>
#include <vector>

#include "stiction/batch_arrays.hpp"

/// Structures that no solver would be glad of: columns out of order and repeated, entries without their mirror, groups
/// interrupted, environments without rows. Everything follows from the generator.
namespace stiction::test {

inline int below(std::mt19937& random, int bound) {
  return static_cast<int>(random() % static_cast<unsigned>(bound));
}

/// About `cones` cones; each row stores up to `most` entries, near its own row or anywhere.
inline Environment<double> random_structure(std::mt19937& random, int cones, int most) {
  Environment<double> env;
  const int one_kind = below(random, 8);
  const int kinds = below(random, 4) == 0 ? 6 : 5;  // one semidefinite matrix makes an environment sparse
  for (int c = 0; c < cones; ++c) {
    const auto kind =
        static_cast<ConeKind>(one_kind < kinds && below(random, 8) != 0 ? one_kind : below(random, kinds));
    const Index rows = carries_friction(kind)           ? 2 + below(random, 5)
                       : kind == ConeKind::semidefinite ? 3 * (1 + below(random, 2))
                                                        : 1;
    env.cones.push_back({kind, rows, below(random, 4) - 1});
    env.b.resize(env.b.size() + static_cast<std::size_t>(rows));
  }
  const int n = static_cast<int>(env.b.size()), reach = 1 + below(random, n + 1);
  const bool in_order = below(random, 2) == 0, mirrored = below(random, 2) == 0;
  std::vector<std::vector<Index>> columns(env.b.size());
  for (int row = 0; row < n; ++row) {
    for (int count = below(random, most + 1); count > 0; --count) {
      const int column = std::clamp(row + below(random, 2 * reach + 1) - reach, 0, n - 1);
      columns[static_cast<std::size_t>(row)].push_back(column);
      if (mirrored) columns[static_cast<std::size_t>(column)].push_back(row);
    }
  }
  for (std::vector<Index>& row : columns) {
    if (in_order) std::sort(row.begin(), row.end());
    env.column.insert(env.column.end(), row.begin(), row.end());
    env.row_offsets.push_back(static_cast<Index>(env.column.size()));
  }
  env.A.resize(env.column.size());
  return env;
}

/// Empty, dense of few rows, dense of many, sparse.
inline Environment<double> random_structure(std::mt19937& random) {
  switch (below(random, 8)) {
    case 0:
      return {};
    case 1:
      return random_structure(random, 24, 60);
    case 2:
    case 3:
    case 4:
      return random_structure(random, 30 + below(random, 60), 1 + below(random, 5));
    default:
      return random_structure(random, 1 + below(random, 12), below(random, 5));
  }
}

inline ContactBatch<double> random_structures(std::mt19937& random) {
  ContactBatch<double> batch;
  for (int env = 1 + below(random, 4); env > 0; --env) batch.add(random_structure(random));
  return batch;
}

/// The integers of a batch, each array exactly as long as in its view. Empty counts mean none.
struct Integers {
  std::vector<Offset> env_row_offsets, env_cone_offsets, cone_row_offsets, row_offsets, column_offsets;
  std::vector<Index> env_row_counts, env_cone_counts, cone_group, row_counts, column;
  std::vector<ConeKind> cone_kind;

  explicit Integers(const ContactBatch<double>& batch)
      : env_row_offsets(batch.arrays().env_row_offsets),
        env_cone_offsets(batch.arrays().env_cone_offsets),
        cone_row_offsets(batch.arrays().cone_row_offsets),
        row_offsets(batch.arrays().row_offsets),
        cone_group(batch.arrays().cone_group),
        column(batch.arrays().column),
        cone_kind(batch.arrays().cone_kind) {}
  Integers() = default;

  [[nodiscard]] ContactBatchView<double> view() const {
    ContactBatchView<double> view;
    view.env_count = static_cast<Offset>(env_row_offsets.size()) - 1;
    view.cone_count = static_cast<Offset>(cone_kind.size());
    view.row_count = static_cast<Offset>(row_offsets.size()) - 1;
    view.nonzero_count = nonzeros;
    for_each_cone_array(view, PointAt{}, view, *this);
    for_each_count_array(view, PointAt{}, view, *this);
    view.row_offsets = row_offsets.data();
    view.row_counts = row_counts.empty() ? nullptr : row_counts.data();
    view.column = column.data();
    view.column_offsets = column_offsets.empty() ? nullptr : column_offsets.data();
    view.column_count = static_cast<Offset>(column.size());
    return view;
  }

  Offset nonzeros = row_offsets.empty() ? 0 : row_offsets.back();
};

/// The environments with room between them, between their rows and between entries; no column keeps its place.
inline Integers with_room(const ContactBatchView<double>& batch, std::mt19937& random) {
  Integers wide;
  wide.env_row_offsets = wide.env_cone_offsets = wide.row_offsets = {0};
  for (Offset env = 0; env < batch.env_count; ++env) {
    const Offset first_row = batch.env_row_offsets[env], first_cone = batch.env_cone_offsets[env];
    const Index rows = batch.env_rows(env), cones = batch.env_cones(env);
    const Offset begin = wide.env_row_offsets.back();
    for (Index row = 0; row < rows + below(random, 4); ++row) {
      const bool used = row < rows;
      const Index entries = used ? batch.row_entries(first_row + row) : below(random, 3);
      wide.row_counts.push_back(used ? entries : below(random, entries + 1));
      wide.row_offsets.push_back(wide.row_offsets.back() + entries + below(random, 3));
      for (int skip = below(random, 2); skip > 0; --skip) wide.column.push_back(-5);
      wide.column_offsets.push_back(static_cast<Offset>(wide.column.size()));
      for (Index k = 0; k < entries; ++k) wide.column.push_back(used ? batch.row_columns(first_row + row)[k] : 1 << 30);
    }
    wide.env_row_offsets.push_back(static_cast<Offset>(wide.row_offsets.size()) - 1);
    for (Index cone = 0; cone < cones; ++cone) {
      wide.cone_kind.push_back(batch.cone_kind[first_cone + cone]);
      wide.cone_row_offsets.push_back(begin + batch.cone_row_offsets[first_cone + cone] - first_row);
      wide.cone_group.push_back(batch.cone_group == nullptr ? -1 : batch.cone_group[first_cone + cone]);
    }
    for (int room = 1 + below(random, 3); room > 0; --room) {
      wide.cone_kind.push_back(static_cast<ConeKind>(99));
      wide.cone_row_offsets.push_back(begin + rows);
      wide.cone_group.push_back(1);
    }
    wide.env_cone_offsets.push_back(static_cast<Offset>(wide.cone_kind.size()));
    wide.env_row_counts.push_back(rows);
    wide.env_cone_counts.push_back(cones);
  }
  wide.cone_row_offsets.push_back(wide.env_row_offsets.back());
  wide.nonzeros = wide.row_offsets.back();
  // If there is room for entries there is an array, though nothing may lie in it.
  if (wide.column.empty()) wide.column.push_back(-5);
  return wide;
}

}  // namespace stiction::test
