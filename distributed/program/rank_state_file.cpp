#include "distributed/program/rank_state_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>

#include "cli/output.hpp"
#include "distributed/transport/letters.hpp"
#include "stiction/error.hpp"

namespace stiction::distributed {

RankStateFile::RankStateFile(Transport& transport, const std::optional<std::filesystem::path>& path,
                             const std::string& header)
    : transport_(transport), path_(path) {
  if (!path_) return;
  name_ = path_->string();
  const bool is_first = transport.rank() == 0;
  if (is_first) cli::require_writable(*path_);
  if (*path_ != "-") {
    if (is_first) file_.open(*path_, std::ios::out | std::ios::binary | std::ios::trunc);
    static_cast<void>(gather(transport_, char{0}));  // it is there now
    if (!is_first) file_.open(*path_, std::ios::in | std::ios::out | std::ios::binary);
    if (!file_) fail();
  }
  append(is_first ? header : std::string());
}

void RankStateFile::fail() const {
  throw Error(ErrorCode::io, fmt::format("{}: rank {} cannot write it; name a file in a folder that all ranks see",
                                         name_, transport_.rank()));
}

void RankStateFile::append(const std::string& text) {
  if (!path_) return;
  if (*path_ == "-") return append_to_standard_output(text);
  const std::vector<std::uint64_t> sizes = gather(transport_, std::uint64_t{text.size()});
  std::uint64_t begin = length_;
  for (std::size_t rank = 0; rank < sizes.size(); ++rank) {
    if (rank < static_cast<std::size_t>(transport_.rank())) begin += sizes[rank];
    length_ += sizes[rank];
  }
  if (text.empty()) return;
  file_.seekp(static_cast<std::streamoff>(begin));
  if (!file_.write(text.data(), static_cast<std::streamsize>(text.size())).flush()) fail();
}

void RankStateFile::append_to_standard_output(const std::string& text) {
  std::vector<Letter> letters(static_cast<std::size_t>(transport_.size()));
  Letter own(text.size());
  std::copy_n(reinterpret_cast<const std::byte*>(text.data()), text.size(), own.bytes().begin());
  letters.front() = std::move(own);
  for (const Letter& letter : exchange_with_all(transport_, letters))
    if (std::fwrite(letter.bytes().data(), 1, letter.size(), stdout) != letter.size()) fail();
}

void RankStateFile::close() {
  if (!path_ || *path_ == "-") return;
  file_.close();
  if (!file_) fail();
}

}  // namespace stiction::distributed
