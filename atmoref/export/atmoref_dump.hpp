// atmoref_dump.hpp: writes draw dumps that `atmoref check` judges. C++11, this header alone, no other library.
//
//     atmoref::DumpWriter dump("dump", "my engine 1.2", /* bottom_first = */ true);   // as glReadPixels returns rows
//     dump.add("opaque", "frame", "unorm8", pixels, width, height, 4);                // unsigned char, RGBA
//     dump.add("light_0/slab_000/main", "frame", "float32", floats, width, height, 3);
//     dump.close();                                                                   // writes manifest.json
//
// The directory must exist. Types: unsigned char (unorm8), unsigned short (unorm10/12/16), unsigned int (depth24),
// float (float32, r11g11b10f; also values of float16 that were widened). Names of draws and buffers are those that
// `atmoref render SCENE --stages DIR` lists. Errors: every call returns false and keeps the first reason in `error()`.
// Little-endian machines only.

#ifndef ATMOREF_DUMP_HPP
#define ATMOREF_DUMP_HPP

#include <cstddef>
#include <cstdio>
#include <string>
#include <vector>

namespace atmoref {

template <typename T> struct TypeCode;
template <> struct TypeCode<unsigned char> { static const char* text() { return "|u1"; } };
template <> struct TypeCode<unsigned short> { static const char* text() { return "<u2"; } };
template <> struct TypeCode<unsigned int> { static const char* text() { return "<u4"; } };
template <> struct TypeCode<float> { static const char* text() { return "<f4"; } };

class DumpWriter {
public:
    explicit DumpWriter(const std::string& directory, const std::string& about = "", bool bottom_first = false)
        : directory_(directory), about_(about), bottom_first_(bottom_first), count_(0) {}

    // Writes what `buffer` holds after `draw`: `channels` numbers a texel, rows one after the other.
    template <typename T>
    bool add(const std::string& draw, const std::string& buffer, const std::string& format, const T* texels,
             std::size_t width, std::size_t height, std::size_t channels) {
        if (!error_.empty()) return false;
        if (!texels || !width || !height || channels < 1 || channels > 4) return fail("add: empty, or not 1 to 4 channels");
        char number[32];
        std::snprintf(number, sizeof number, "%04lu.", static_cast<unsigned long>(count_));
        const std::string file = number + plain(draw.empty() ? buffer : draw) + ".npy";
        std::string shape = "(" + text(height) + ", " + text(width) + ", " + text(channels) + ")";
        std::string header = std::string("{'descr': '") + TypeCode<T>::text() + "', 'fortran_order': False, 'shape': " + shape + ", }";
        while ((10 + header.size() + 1) % 64) header += ' ';
        header += '\n';
        std::FILE* out = std::fopen((directory_ + "/" + file).c_str(), "wb");
        if (!out) return fail("cannot write " + file + ": does the directory exist?");
        const unsigned char magic[10] = {0x93, 'N', 'U', 'M', 'P', 'Y', 1, 0,
                                         static_cast<unsigned char>(header.size() & 255),
                                         static_cast<unsigned char>(header.size() >> 8)};
        bool good = std::fwrite(magic, 1, 10, out) == 10;
        good = std::fwrite(header.data(), 1, header.size(), out) == header.size() && good;
        const std::size_t row = width * channels;
        for (std::size_t y = 0; y < height && good; ++y) {
            const std::size_t at = bottom_first_ ? height - 1 - y : y;
            good = std::fwrite(texels + at * row, sizeof(T), row, out) == row;
        }
        good = std::fclose(out) == 0 && good;
        if (!good) return fail("cannot write " + file + " completely: is the disk full?");
        if (count_++) entries_ += ",\n";
        entries_ += "  {\"draw\": " + quoted(draw) + ", \"buffer\": " + quoted(buffer) + ", \"format\": " + quoted(format) +
                    ", \"file\": " + quoted(file) + "}";
        return true;
    }

    // Writes the manifest; without one a directory is no dump.
    bool close() {
        if (!error_.empty()) return false;
        const std::string all = "{\n \"kind\": \"atmoref stages\", \"manifest\": 1, \"crop\": null, \"about\": " + quoted(about_) +
                                ",\n \"draws\": [\n" + entries_ + "\n ]\n}\n";
        std::FILE* out = std::fopen((directory_ + "/manifest.json").c_str(), "wb");
        if (!out) return fail("cannot write manifest.json");
        const bool good = std::fwrite(all.data(), 1, all.size(), out) == all.size();
        return (std::fclose(out) == 0 && good) || fail("cannot write manifest.json completely");
    }

    const std::string& error() const { return error_; }

private:
    bool fail(const std::string& why) { if (error_.empty()) error_ = why; return false; }
    static std::string text(std::size_t n) {
        char digits[32];
        std::snprintf(digits, sizeof digits, "%lu", static_cast<unsigned long>(n));
        return digits;
    }
    static std::string plain(std::string name) {
        for (std::size_t i = 0; i < name.size(); ++i) if (name[i] == '/' || name[i] == '\\' || name[i] == ':') name[i] = '.';
        return name;
    }
    static std::string quoted(const std::string& s) {
        std::string out = "\"";
        for (std::size_t i = 0; i < s.size(); ++i) {
            const unsigned char c = static_cast<unsigned char>(s[i]);
            if (c == '"' || c == '\\') { out += '\\'; out += s[i]; }
            else if (c < 32) { char code[8]; std::snprintf(code, sizeof code, "\\u%04x", c); out += code; }
            else out += s[i];
        }
        return out + "\"";
    }
    std::string directory_, about_, entries_, error_;
    bool bottom_first_;
    std::size_t count_;
};

}  // namespace atmoref

#endif
