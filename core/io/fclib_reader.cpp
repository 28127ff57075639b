#include <limits>

#include "core/io/condense.hpp"
#include "core/io/readers.hpp"
#include "core/io/sparse.hpp"
#include "stiction/error.hpp"

namespace stiction::io {
namespace {

/// Reads a matrix of FCLIB. In triplets `i` is the row and `p` the column, as all public files have it (the comment in
/// fclib.h says the opposite). nzmax is ignored, since it may exceed the entries in use; duplicates add up.
Csr read_matrix(const InputFile& file, const std::string& path, std::size_t rows, std::size_t cols) {
  const std::int64_t m = file.integer(path + "/m"), n = file.integer(path + "/n"), nz = file.integer(path + "/nz");
  if (m != static_cast<std::int64_t>(rows) || n != static_cast<std::int64_t>(cols)) {
    file.refuse("matrix '" + path + "' is " + std::to_string(m) + " x " + std::to_string(n) + ", the vectors make it " +
                std::to_string(rows) + " x " + std::to_string(cols));
  }
  if (nz < kByRows) file.refuse_dataset(path + "/nz", "is " + std::to_string(nz) + ", expected -2, -1 or a count");

  Triplets entries;
  entries.val = file.reals(path + "/x");
  entries.row = file.integers<Index>(path + "/i", entries.val.size());
  std::vector<Index> p = file.integers<Index>(path + "/p");
  auto used = static_cast<std::size_t>(nz < 0 ? 0 : nz);
  if (nz >= 0) {
    if (used > entries.val.size() || used > p.size()) {
      file.refuse_dataset(path + "/nz", "counts " + std::to_string(nz) + " triplets, the arrays hold " +
                                            std::to_string(entries.val.size()));
    }
    entries.col = std::move(p);
  } else {
    const std::size_t lines = nz == kByColumns ? cols : rows;
    if (p.size() != lines + 1) {
      file.refuse_dataset(path + "/p",
                          "has " + std::to_string(p.size()) + " elements, expected " + std::to_string(lines + 1));
    }
    const std::vector<Offset> offsets(p.begin(), p.end());
    used = static_cast<std::size_t>(offsets.back() < 0 ? 0 : offsets.back());
    check_offsets(file, path + "/p", offsets, used > entries.val.size() ? entries.val.size() : used);
    entries.col.reserve(used);
    for (std::size_t line = 0; line < lines; ++line) {
      for (Offset k = offsets[line]; k < offsets[line + 1]; ++k) entries.col.push_back(static_cast<Index>(line));
    }
    if (nz == kByRows) {
      entries.row.resize(used);
      std::swap(entries.row, entries.col);
    }
  }
  entries.row.resize(used);
  entries.col.resize(used);
  entries.val.resize(used);
  const auto check = [&](const std::vector<Index>& index, std::size_t count, const char* what) {
    for (std::size_t k = 0; k < used; ++k) {
      if (index[k] < 0 || static_cast<std::size_t>(index[k]) >= count) {
        file.refuse("matrix '" + path + "' has " + what + " " + std::to_string(index[k]) + " at entry " +
                    std::to_string(k) + ", expected 0 to " + std::to_string(count) + " exclusive");
      }
    }
  };
  check(entries.row, rows, "row");
  check(entries.col, cols, "column");
  return by_rows(entries, static_cast<Index>(rows), static_cast<Index>(cols));
}

struct Contacts {
  std::vector<double> mu;  ///< one per contact
  Index dimension = 3;     ///< rows of a contact
};

/// `rows` is the length of the vector that spans all contacts' rows, named `vector`.
Contacts read_contacts(const InputFile& file, const std::string& problem, const char* vector, std::size_t rows) {
  const std::int64_t dimension = file.integer(problem + "/spacedim");
  if (dimension != 2 && dimension != 3) {
    file.refuse_dataset(problem + "/spacedim", "is " + std::to_string(dimension) + ", expected 2 or 3");
  }
  Contacts contacts{file.reals(problem + "/vectors/mu"), static_cast<Index>(dimension)};
  if (rows > std::size_t{std::numeric_limits<Index>::max()} / 2) {
    file.refuse_dataset(problem + "/vectors/" + vector, "has more than 2^30 elements");
  }
  if (contacts.mu.size() * static_cast<std::size_t>(dimension) != rows) {
    file.refuse_dataset(problem + "/vectors/mu", "has " + std::to_string(contacts.mu.size()) + " elements, '" + vector +
                                                     "' has " + std::to_string(rows) + ", expected " +
                                                     std::to_string(dimension) + " times as many");
  }
  return contacts;
}

/// One environment: the contacts' cones, then one free row for each equality.
Recording make_recording(const InputFile& file, const Contacts& contacts, Csr A, std::vector<double> b) {
  ContactBatch<double>::Arrays arrays;
  const std::size_t rows = b.size();
  arrays.mu.assign(rows, 0.0);
  arrays.cone_row_offsets = {0};
  const auto dimension = static_cast<std::size_t>(contacts.dimension);
  for (std::size_t contact = 0; contact < contacts.mu.size(); ++contact) {
    arrays.cone_kind.push_back(ConeKind::friction);
    arrays.cone_row_offsets.push_back(static_cast<Offset>((contact + 1) * dimension));
    for (std::size_t axis = 1; axis < dimension; ++axis) arrays.mu[contact * dimension + axis] = contacts.mu[contact];
  }
  for (std::size_t row = contacts.mu.size() * dimension; row < rows; ++row) {
    arrays.cone_kind.push_back(ConeKind::free);
    arrays.cone_row_offsets.push_back(static_cast<Offset>(row + 1));
  }
  arrays.env_row_offsets = {0, static_cast<Offset>(rows)};
  arrays.env_cone_offsets = {0, static_cast<Offset>(arrays.cone_kind.size())};
  arrays.row_offsets = std::move(A.ptr);
  arrays.column = std::move(A.col);
  arrays.A = std::move(A.val);
  arrays.b = std::move(b);
  arrays.R.assign(rows, 0.0);
  arrays.lo.assign(rows, 0.0);
  arrays.hi.assign(rows, 0.0);
  Recording recording;
  recording.batch = ContactBatch<double>::from_arrays(Law::coulomb, std::move(arrays));
  recording.source = "FCLIB, " + file.name();
  recording.env_name = {file.name()};
  return recording;
}

void extend(std::vector<double>& to, const std::vector<double>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

}  // namespace

// u = W r + V l + q,  0 = V' r + R l + s: the equalities are free rows of one matrix.
Recording read_fclib_local(const InputFile& file) {
  const std::string problem = "fclib_local";
  std::vector<double> b = file.reals(problem + "/vectors/q");
  const std::size_t rows = b.size();
  const Contacts contacts = read_contacts(file, problem, "q", rows);
  Csr A = read_matrix(file, problem + "/W", rows, rows);
  if (file.has(problem + "/V") || file.has(problem + "/R") || file.has(problem + "/vectors/s")) {
    const std::vector<double> s = file.reals(problem + "/vectors/s");
    const Csr V = read_matrix(file, problem + "/V", rows, s.size());
    const Csr R = read_matrix(file, problem + "/R", s.size(), s.size());
    const auto shift = static_cast<Index>(rows), equalities = static_cast<Index>(s.size());
    Triplets entries;
    append(entries, A, 0, 0);
    append(entries, V, 0, shift);
    append(entries, transpose(V, equalities), shift, 0);
    append(entries, R, shift, shift);
    extend(b, s);
    A = by_rows(entries, shift + equalities, shift + equalities);
  }
  return make_recording(file, contacts, std::move(A), std::move(b));
}

// M v = H r + G l + f, u = H' v + w, 0 = G' v + b. With J = [H G]' the rows' motion is J v + [w b], and v is
// eliminated. Then A = J M^-1 J', v_free = M^-1 f, row_target = -[w b].
Recording read_fclib_global(const InputFile& file) {
  const std::string problem = "fclib_global";
  const std::vector<double> f = file.reals(problem + "/vectors/f");
  std::vector<double> offset = file.reals(problem + "/vectors/w");
  const std::size_t rows = offset.size(), dofs = f.size();
  const Contacts contacts = read_contacts(file, problem, "w", rows);
  if (dofs > std::size_t{std::numeric_limits<Index>::max()} / 2) {
    file.refuse_dataset(problem + "/vectors/f", "has more than 2^30 elements");
  }
  Csr M = read_matrix(file, problem + "/M", dofs, dofs);
  Csr J = transpose(read_matrix(file, problem + "/H", dofs, rows), static_cast<Index>(rows));
  if (file.has(problem + "/G") || file.has(problem + "/vectors/b")) {
    const std::vector<double> b = file.reals(problem + "/vectors/b");
    const auto equalities = static_cast<Index>(b.size());
    Triplets entries;
    append(entries, J, 0, 0);
    append(entries, transpose(read_matrix(file, problem + "/G", dofs, b.size()), equalities), static_cast<Index>(rows),
           0);
    extend(offset, b);
    J = by_rows(entries, static_cast<Index>(rows) + equalities, static_cast<Index>(dofs));
  }

  Condensed condensed;
  try {
    condensed = condense(M, J, f);
  } catch (const Error& trouble) {
    file.refuse(trouble.what());
  }
  std::vector<double> b = offset;
  for (std::size_t row = 0; row < b.size(); ++row) {
    for (auto k = static_cast<std::size_t>(J.ptr[row]); k < static_cast<std::size_t>(J.ptr[row + 1]); ++k) {
      b[row] += J.val[k] * condensed.v_free[static_cast<std::size_t>(J.col[k])];
    }
  }
  Recording recording = make_recording(file, contacts, std::move(condensed.A), std::move(b));
  recording.env_dof_offsets = {0, static_cast<Offset>(dofs)};
  recording.J = std::move(J);
  recording.M = std::move(M);
  recording.v_free = std::move(condensed.v_free);
  for (const double value : offset) recording.row_target.push_back(-value);
  return recording;
}

}  // namespace stiction::io
