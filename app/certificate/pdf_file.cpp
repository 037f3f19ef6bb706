// Only std::shared_ptr, not the pointer of older versions of qpdf.
#define POINTERHOLDER_TRANSITION 4

#include "app/certificate/pdf_file.h"

#include <fmt/format.h>

#include <map>
#include <memory>
#include <qpdf/Buffer.hh>
#include <qpdf/QPDF.hh>
#include <qpdf/QPDFEmbeddedFileDocumentHelper.hh>
#include <qpdf/QPDFPageDocumentHelper.hh>
#include <qpdf/QPDFWriter.hh>
#include <set>

#include "app/io/sha256.h"

namespace plumbline::app {
namespace {

/// "D:20260131123456Z"
std::string pdf_date(const std::string& utc) {
  std::string digits;
  for (const char c : utc) {
    if (c >= '0' && c <= '9') digits += c;
  }
  return "D:" + digits + "Z";
}

std::string text_of(const std::shared_ptr<Buffer>& buffer) {
  return {reinterpret_cast<const char*>(buffer->getBuffer()), buffer->getSize()};
}

/// Writes all that an object refers to in a form that does not depend on how the file is laid out:
/// objects are numbered in the order in which they are met, streams are decoded.
class Transcript {
 public:
  std::string text;

  void add(QPDFObjectHandle object) {
    if (object.isIndirect()) {
      const auto [it, fresh] = numbers_.emplace(object.getObjGen(), numbers_.size());
      text += fmt::format("#{} ", it->second);
      if (!fresh) return;
    }
    if (object.isStream()) {
      add_dictionary(object.getDict(), {"/Length", "/Filter", "/DecodeParms"});
      const std::string data = text_of(object.getStreamData(qpdf_dl_generalized));
      text += fmt::format("stream {} {} ", data.size(), sha256(data));
    } else if (object.isDictionary()) {
      add_dictionary(object, {});
    } else if (object.isArray()) {
      text += "[ ";
      for (int i = 0; i < object.getArrayNItems(); ++i) add(object.getArrayItem(i));
      text += "] ";
    } else {
      text += object.unparseResolved() + " ";
    }
  }

 private:
  void add_dictionary(QPDFObjectHandle dictionary, const std::set<std::string>& without) {
    text += "<< ";
    for (const std::string& key : dictionary.getKeys()) {
      // The way up leads to the whole document.
      if (key == "/Parent" || without.count(key) > 0) continue;
      text += key + " ";
      add(dictionary.getKey(key));
    }
    text += ">> ";
  }

  std::map<QPDFObjGen, std::size_t> numbers_;
};

void open(QPDF& pdf, std::string_view bytes, const std::string& name) {
  pdf.setSuppressWarnings(true);
  pdf.processMemoryFile(name.c_str(), bytes.data(), bytes.size());
}

}  // namespace

Result<std::string> attach(std::string_view bytes, const std::vector<Attachment>& attachments,
                           const std::string& created_utc) {
  try {
    QPDF pdf;
    open(pdf, bytes, "certificate.pdf");
    QPDFEmbeddedFileDocumentHelper files(pdf);
    QPDFObjectHandle associated = QPDFObjectHandle::newArray();
    for (const Attachment& attachment : attachments) {
      auto stream = QPDFEFStreamObjectHelper::createEFStream(pdf, attachment.content);
      stream.setSubtype(attachment.mime);
      stream.setCreationDate(pdf_date(created_utc));
      stream.setModDate(pdf_date(created_utc));
      auto file = QPDFFileSpecObjectHelper::createFileSpec(pdf, attachment.name, stream);
      file.setDescription(attachment.description);
      file.getObjectHandle().replaceKey("/AFRelationship", QPDFObjectHandle::newName("/Source"));
      files.replaceEmbeddedFile(attachment.name, file);
      associated.appendItem(file.getObjectHandle());
    }
    pdf.getRoot().replaceKey("/AF", associated);
    QPDFWriter writer(pdf);
    writer.setOutputMemory();
    writer.setDeterministicID(true);
    writer.write();
    return text_of(writer.getBufferSharedPointer());
  } catch (const std::exception& error) {
    return fail(ErrorCode::internal, fmt::format("certificate.pdf: {}", error.what()));
  }
}

Result<OpenedPdf> open_pdf(std::string_view bytes, const std::string& name) {
  try {
    QPDF pdf;
    open(pdf, bytes, name);
    if (pdf.anyWarnings()) {
      return fail(ErrorCode::input, fmt::format("{}: damaged PDF: {}", name,
                                                pdf.getWarnings().front().getMessageDetail()));
    }
    OpenedPdf opened;
    Transcript transcript;
    pdf.pushInheritedAttributesToPage();
    for (const QPDFPageObjectHelper& page : QPDFPageDocumentHelper(pdf).getAllPages()) {
      transcript.add(page.getObjectHandle());
    }
    opened.pages_sha256 = sha256(transcript.text);
    QPDFEmbeddedFileDocumentHelper files(pdf);
    for (const auto& [key, file] : files.getEmbeddedFiles()) {
      auto stream = QPDFEFStreamObjectHelper(file->getEmbeddedFileStream());
      opened.attachments.push_back(
          {file->getFilename(), stream.getSubtype(), file->getDescription(),
           text_of(stream.getObjectHandle().getStreamData(qpdf_dl_generalized))});
    }
    return opened;
  } catch (const std::exception& error) {
    return fail(ErrorCode::input, fmt::format("{}: not a usable PDF: {}", name, error.what()));
  }
}

}  // namespace plumbline::app
