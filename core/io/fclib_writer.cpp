#include <limits>

#include "core/base/fp_env.hpp"
#include "core/io/hdf5_out.hpp"
#include "core/io/sparse.hpp"
#include "stiction/error.hpp"
#include "stiction/io.hpp"

namespace stiction::io {
namespace {

[[noreturn]] void refuse(const std::string& sentence) {
  throw Error(ErrorCode::invalid_argument, "write_fclib_local: " + sentence);
}

std::size_t at(Offset offset) {
  return static_cast<std::size_t>(offset);
}

void integer(OutputFile& file, const std::string& path, std::int32_t value) {
  file.array(path, std::span<const std::int32_t>(&value, 1));
}

/// mu of each contact, and the common number of rows; refuses batches that FCLIB cannot hold.
struct Contacts {
  std::vector<double> mu;
  Index dimension = 3;
};

Contacts contacts_of(const ContactBatch<double>::Arrays& arrays, Offset env) {
  Contacts contacts;
  const Offset first = arrays.env_cone_offsets[at(env)];
  for (Offset cone = first; cone < arrays.env_cone_offsets[at(env) + 1]; ++cone) {
    const std::string name = "cone " + std::to_string(cone - first) + " of environment " + std::to_string(env);
    if (arrays.cone_kind[at(cone)] != ConeKind::friction) {
      refuse(name + " is " + to_string(arrays.cone_kind[at(cone)]) + ", FCLIB holds friction cones only");
    }
    const Offset row = arrays.cone_row_offsets[at(cone)];
    const auto size = static_cast<Index>(arrays.cone_row_offsets[at(cone) + 1] - row);
    if (cone == first) contacts.dimension = size;
    if ((size != 2 && size != 3) || size != contacts.dimension) {
      refuse(name + " has " + std::to_string(size) + " rows, FCLIB holds cones that all have 2 rows or all have 3");
    }
    const double mu = arrays.mu[at(row) + 1];
    if (arrays.mu[at(row + size) - 1] != mu) {
      refuse(name + " has a different mu for each axis (" + std::to_string(mu) + ", " +
             std::to_string(arrays.mu[at(row + size) - 1]) + "), FCLIB holds one");
    }
    contacts.mu.push_back(mu);
  }
  return contacts;
}

}  // namespace

void write_fclib_local(const std::filesystem::path& path, const Recording& recording, Offset env) {
  const ScopedFpEnv fp_env;
  if (env < 0 || env >= recording.batch.env_count()) {
    refuse("environment " + std::to_string(env) + " is not there, the batch has " +
           std::to_string(recording.batch.env_count()));
  }
  if (recording.batch.law() != Law::coulomb) {
    refuse("the batch has the convex law, FCLIB means the coulomb law; set_law(Law::coulomb) if that is meant");
  }
  const auto& arrays = recording.batch.arrays();
  const Contacts contacts = contacts_of(arrays, env);
  const Offset first = arrays.env_row_offsets[at(env)], last = arrays.env_row_offsets[at(env) + 1];
  const auto rows = static_cast<Index>(last - first);
  Triplets entries;
  for (Offset row = first; row < last; ++row) {
    const auto here = static_cast<Index>(row - first);
    for (Offset k = arrays.row_offsets[at(row)]; k < arrays.row_offsets[at(row) + 1]; ++k) {
      const Index column = arrays.column[at(k)];
      if (column < 0 || column >= rows) {
        refuse("column " + std::to_string(column) + " of A is outside of environment " + std::to_string(env) +
               ", which has " + std::to_string(rows) + " rows");
      }
      entries.add(here, column, arrays.A[at(k)]);
    }
    if (arrays.R[at(row)] != 0.0) entries.add(here, here, arrays.R[at(row)]);
  }
  const Csr W = by_rows(entries, rows, rows);
  if (W.val.size() > at(std::numeric_limits<std::int32_t>::max())) refuse("FCLIB counts entries of W in 32 bits");

  OutputFile file(path);
  file.group("fclib_local");
  integer(file, "fclib_local/spacedim", contacts.dimension);
  file.group("fclib_local/W");
  integer(file, "fclib_local/W/nzmax", static_cast<std::int32_t>(W.val.size()));
  integer(file, "fclib_local/W/m", rows);
  integer(file, "fclib_local/W/n", rows);
  integer(file, "fclib_local/W/nz", kByRows);
  file.array("fclib_local/W/p", std::vector<std::int32_t>(W.ptr.begin(), W.ptr.end()));
  file.array("fclib_local/W/i", W.col);
  file.array("fclib_local/W/x", W.val);
  file.group("fclib_local/vectors");
  file.array("fclib_local/vectors/q", std::vector<double>(arrays.b.begin() + first, arrays.b.begin() + last));
  file.array("fclib_local/vectors/mu", contacts.mu);
  file.group("fclib_local/info");
  const std::string name =
      recording.env_name.empty() ? "environment " + std::to_string(env) : recording.env_name[at(env)];
  file.text("fclib_local/info/title", name);
  file.text("fclib_local/info/description", recording.source);
  file.text("fclib_local/info/math_info", "");
  file.commit();
}

}  // namespace stiction::io
