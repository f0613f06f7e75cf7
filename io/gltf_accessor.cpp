#include "io/gltf_accessor.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>

#include "io/gltf_sections.h"

namespace shoal::gltf {

static_assert(std::endian::native == std::endian::little, "glTF buffers are little-endian");

namespace {

/// Sparse indices are read, checked and searched in runs of this many: 64 KiB of 32-bit indices.
constexpr uint64_t kSparseRun = 16384;

struct ElementLayout {
  uint64_t stride;        ///< from element to element
  uint32_t columns;       ///< 1, but for matrices
  uint32_t rows;          ///< components of a column
  uint64_t column_bytes;  ///< with padding
};

ElementLayout layout_of(const Accessor& accessor, uint64_t stride) {
  const uint32_t bytes = component_bytes(accessor.type);
  if (!accessor.matrix) return {stride, 1, accessor.components, uint64_t{bytes} * accessor.components};
  const uint32_t side = accessor.components == 4 ? 2 : accessor.components == 9 ? 3 : 4;
  return {stride, side, side, (uint64_t{side} * bytes + 3) / 4 * 4};
}

template <class T, class Out, class Map>
void convert(const std::byte* bytes, const ElementLayout& layout, uint64_t n, Out* out, Map map) {
  for (uint64_t i = 0; i < n; ++i, bytes += layout.stride) {
    for (uint32_t column = 0; column < layout.columns; ++column) {
      const std::byte* source = bytes + column * layout.column_bytes;
      for (uint32_t row = 0; row < layout.rows; ++row, source += sizeof(T)) {
        T value;
        std::memcpy(&value, source, sizeof(T));
        *out++ = map(value);
      }
    }
  }
}

/// glTF 2.0, section 3.11, "Normalized accessors": c / max, and max(c / max, -1) where signed.
template <class T>
float normalized(T value) {
  return std::max(static_cast<float>(value) / static_cast<float>(std::numeric_limits<T>::max()), -1.0f);
}

template <class T>
void convert_integers(const std::byte* bytes, const ElementLayout& layout, bool scale, uint64_t n, float* out) {
  if (scale) {
    convert<T>(bytes, layout, n, out, [](T value) { return normalized(value); });
  } else {
    convert<T>(bytes, layout, n, out, [](T value) { return static_cast<float>(value); });
  }
}

void convert_floats(const std::byte* bytes, const ElementLayout& layout, const Accessor& accessor, uint64_t n,
                    float* out) {
  switch (accessor.type) {
    case ComponentType::kByte:
      return convert_integers<int8_t>(bytes, layout, accessor.normalized, n, out);
    case ComponentType::kUnsignedByte:
      return convert_integers<uint8_t>(bytes, layout, accessor.normalized, n, out);
    case ComponentType::kShort:
      return convert_integers<int16_t>(bytes, layout, accessor.normalized, n, out);
    case ComponentType::kUnsignedShort:
      return convert_integers<uint16_t>(bytes, layout, accessor.normalized, n, out);
    case ComponentType::kUnsignedInt:
      return convert_integers<uint32_t>(bytes, layout, false, n, out);  // glTF scales no 32-bit integers
    case ComponentType::kFloat:
      return convert<float>(bytes, layout, n, out, [](float value) { return value; });
  }
}

void convert_indices(const std::byte* bytes, uint64_t stride, ComponentType type, uint64_t n, uint32_t* out) {
  const ElementLayout layout{stride, 1, 1, 0};
  const auto widen = [](auto value) { return static_cast<uint32_t>(value); };
  if (type == ComponentType::kUnsignedByte) return convert<uint8_t>(bytes, layout, n, out, widen);
  if (type == ComponentType::kUnsignedShort) return convert<uint16_t>(bytes, layout, n, out, widen);
  convert<uint32_t>(bytes, layout, n, out, widen);
}

}  // namespace

Error AccessorReader::error(const std::string& message) const {
  return Error{ErrorCode::kInput, fmt::format("{}: accessors[{}]: {}", document_->path, accessor_, message)};
}

Result<AccessorReader> AccessorReader::open(BufferFiles& files, const Document& document, uint32_t accessor) {
  const Accessor& source = document.accessors[accessor];
  AccessorReader reader;
  reader.files_ = &files;
  reader.document_ = &document;
  reader.accessor_ = accessor;
  reader.count_ = source.count;
  reader.components_ = source.components;
  reader.element_bytes_ = element_bytes(source);
  reader.stride_ = reader.element_bytes_;
  if (source.view && document.views[*source.view].byte_stride != 0) {
    reader.stride_ = document.views[*source.view].byte_stride;
  }
  reader.block_elements_ = kReadBytes / reader.stride_;
  const uint64_t blocks = (reader.count_ + reader.block_elements_ - 1) / reader.block_elements_;
  reader.numbers_.resize(std::clamp<uint64_t>(blocks, 1, kBlockCount), kNoBlock);
  if (source.view) SHOAL_RETURN_IF_ERROR(files.check(document.views[*source.view].buffer));
  if (source.sparse) SHOAL_RETURN_IF_ERROR(reader.check_sparse_indices());
  return reader;
}

Status AccessorReader::read_sparse_indices(uint64_t first, std::span<uint32_t> out) {
  const SparseAccessor& sparse = *document_->accessors[accessor_].sparse;
  const BufferView& view = document_->views[sparse.indices_view];
  const uint64_t index_bytes = component_bytes(sparse.indices_type);
  std::vector<std::byte> bytes(out.size() * index_bytes);
  SHOAL_RETURN_IF_ERROR(
      files_->read(view.buffer, view.byte_offset + sparse.indices_offset + first * index_bytes, bytes));
  convert_indices(bytes.data(), index_bytes, sparse.indices_type, out.size(), out.data());
  return {};
}

Status AccessorReader::check_sparse_indices() {
  const SparseAccessor& sparse = *document_->accessors[accessor_].sparse;
  SHOAL_RETURN_IF_ERROR(files_->check(document_->views[sparse.indices_view].buffer));
  SHOAL_RETURN_IF_ERROR(files_->check(document_->views[sparse.values_view].buffer));
  std::vector<uint32_t> run(std::min(sparse.count, kSparseRun));
  uint64_t least = 0;
  for (uint64_t first = 0; first < sparse.count; first += kSparseRun) {
    const std::span<uint32_t> indices(run.data(), std::min(kSparseRun, sparse.count - first));
    SHOAL_RETURN_IF_ERROR(read_sparse_indices(first, indices));
    sparse_firsts_.push_back(indices[0]);
    for (size_t i = 0; i < indices.size(); ++i) {
      if (indices[i] < least || indices[i] >= count_) {
        return error(fmt::format("sparse index {}: expected from {} to below {}, strictly increasing, found {}",
                                 first + i, least, count_, indices[i]));
      }
      least = uint64_t{indices[i]} + 1;
    }
  }
  return {};
}

Status AccessorReader::apply_sparse(uint64_t first, uint64_t n, std::span<std::byte> bytes) {
  const SparseAccessor& sparse = *document_->accessors[accessor_].sparse;
  const BufferView& view = document_->views[sparse.values_view];
  const auto after = std::upper_bound(sparse_firsts_.begin(), sparse_firsts_.end(), first);
  uint64_t run = static_cast<uint64_t>(after - sparse_firsts_.begin());
  run -= run > 0;
  std::vector<uint32_t> indices;
  std::vector<std::byte> values;
  for (; run < sparse_firsts_.size() && sparse_firsts_[run] < first + n; ++run) {
    indices.resize(std::min(kSparseRun, sparse.count - run * kSparseRun));
    SHOAL_RETURN_IF_ERROR(read_sparse_indices(run * kSparseRun, indices));
    const auto begin = std::lower_bound(indices.begin(), indices.end(), first);
    const auto end = std::lower_bound(begin, indices.end(), first + n);
    if (begin == end) continue;
    const uint64_t value = run * kSparseRun + static_cast<uint64_t>(begin - indices.begin());
    values.resize(static_cast<size_t>(end - begin) * element_bytes_);  // at most a chunk: indices are distinct
    SHOAL_RETURN_IF_ERROR(
        files_->read(view.buffer, view.byte_offset + sparse.values_offset + value * element_bytes_, values));
    const std::byte* source = values.data();
    for (auto it = begin; it != end; ++it, source += element_bytes_) {
      std::memcpy(bytes.data() + (*it - first) * stride_, source, element_bytes_);
    }
  }
  return {};
}

Result<const std::byte*> AccessorReader::load_blocks(uint64_t number, uint64_t last) {
  const Accessor& accessor = document_->accessors[accessor_];
  const size_t slot = number % numbers_.size();
  SHOAL_ASSIGN_OR_RETURN(const auto slots, slots_.reserve(numbers_.size() * block_bytes()));
  std::byte* const begin = slots.data() + slot * block_bytes();
  if (numbers_[slot] == number) return static_cast<const std::byte*>(begin);
  size_t run = 1;
  while (slot + run < numbers_.size() && number + run <= last && numbers_[slot + run] != number + run) ++run;
  std::fill_n(numbers_.begin() + static_cast<std::ptrdiff_t>(slot), run, kNoBlock);
  const uint64_t first = number * block_elements_, n = std::min(run * block_elements_, count_ - first);
  const std::span<std::byte> bytes(begin, (n - 1) * stride_ + element_bytes_);
  if (accessor.view) {
    const BufferView& view = document_->views[*accessor.view];
    const uint64_t offset = view.byte_offset + accessor.byte_offset + first * stride_;
    SHOAL_RETURN_IF_ERROR(files_->read(view.buffer, offset, bytes));
  } else {
    std::fill(bytes.begin(), bytes.end(), std::byte{0});
  }
  if (accessor.sparse) SHOAL_RETURN_IF_ERROR(apply_sparse(first, n, bytes));
  for (size_t i = 0; i < run; ++i) numbers_[slot + i] = number + i;
  return static_cast<const std::byte*>(begin);
}

template <class Convert>
Status AccessorReader::each_piece(uint64_t first, uint64_t n, Convert&& convert_piece) {
  if (first > count_ || n > count_ - first) {
    return error(fmt::format("expected elements below {}, found {} from {}", count_, n, first));
  }
  if (n == 0) return {};
  const uint64_t last = (first + n - 1) / block_elements_;
  while (n > 0) {
    const uint64_t skip = first % block_elements_, piece = std::min(n, block_elements_ - skip);
    SHOAL_ASSIGN_OR_RETURN(const std::byte* bytes, load_blocks(first / block_elements_, last));
    convert_piece(bytes + skip * stride_, piece);
    first += piece;
    n -= piece;
  }
  return {};
}

Status AccessorReader::read_floats(uint64_t first, uint64_t n, std::span<float> out) {
  SHOAL_CHECK(out.size() / components_ >= n);
  const Accessor& accessor = document_->accessors[accessor_];
  const ElementLayout layout = layout_of(accessor, stride_);
  float* target = out.data();
  return each_piece(first, n, [&](const std::byte* bytes, uint64_t piece) {
    convert_floats(bytes, layout, accessor, piece, target);
    target += piece * components_;
  });
}

Status AccessorReader::read_indices(uint64_t first, uint64_t n, std::span<uint32_t> out) {
  SHOAL_CHECK(out.size() >= n);
  const ComponentType type = document_->accessors[accessor_].type;
  if (components_ != 1 || (type != ComponentType::kUnsignedByte && type != ComponentType::kUnsignedShort &&
                           type != ComponentType::kUnsignedInt)) {
    return error("expected unsigned integer scalars as indices");
  }
  uint32_t* target = out.data();
  return each_piece(first, n, [&](const std::byte* bytes, uint64_t piece) {
    convert_indices(bytes, stride_, type, piece, target);
    target += piece;
  });
}

}  // namespace shoal::gltf
