// XXH3 of bytes that come piece by piece: says whether a file is what it was, not whether somebody meant it to look so.
// Called by engine/scene_content and engine/batch_plan. Thread rule: one owner. Cost: tens of GB/s.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>

namespace shoal {

class ContentHash {
 public:
  ContentHash();
  ~ContentHash();
  ContentHash(const ContentHash&) = delete;
  ContentHash& operator=(const ContentHash&) = delete;

  void add(std::span<const std::byte> bytes);
  /// With its length: "a", "bc" is not "ab", "c".
  void add_text(std::string_view text);
  void add_number(uint64_t number);
  uint64_t value() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace shoal
