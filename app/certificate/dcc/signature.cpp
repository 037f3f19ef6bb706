#include "app/certificate/dcc/signature.h"

#include <fmt/format.h>
#include <libxml/parser.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/x509.h>
#include <xmlsec/app.h>
#include <xmlsec/crypto.h>
#include <xmlsec/errors.h>
#include <xmlsec/openssl/evp.h>
#include <xmlsec/templates.h>
#include <xmlsec/xmldsig.h>
#include <xmlsec/xmlsec.h>
#include <xmlsec/xmltree.h>

#include <array>
#include <memory>

#include "app/certificate/dcc/xml_tree.h"
#include "app/io/read_file.h"
#include "app/io/sha256.h"

namespace plumbline::app {
namespace {

constexpr int kLeastRsaBits = 2048;

template <auto free_function>
struct FreeBy {
  template <class T>
  void operator()(T* object) const {
    free_function(object);
  }
};
using KeyPtr = std::unique_ptr<EVP_PKEY, FreeBy<EVP_PKEY_free>>;
using X509Ptr = std::unique_ptr<X509, FreeBy<X509_free>>;
using BioPtr = std::unique_ptr<BIO, FreeBy<BIO_free_all>>;
using StorePtr = std::unique_ptr<X509_STORE, FreeBy<X509_STORE_free>>;
using StoreContextPtr = std::unique_ptr<X509_STORE_CTX, FreeBy<X509_STORE_CTX_free>>;
using SignatureContextPtr = std::unique_ptr<xmlSecDSigCtx, FreeBy<xmlSecDSigCtxDestroy>>;

const xmlChar* chars(const char* text) { return reinterpret_cast<const xmlChar*>(text); }

/// The library writes its troubles to stderr; what matters of them is said by us.
void quiet(const char*, int, const char*, const char*, const char*, int, const char*) {}

/// Once a process; xmlsec has no other way.
bool library_ready() {
  static const bool ready = [] {
    const bool good =
        xmlSecInit() >= 0 && xmlSecCryptoAppInit(nullptr) >= 0 && xmlSecCryptoInit() >= 0;
    xmlSecErrorsSetCallback(quiet);
    return good;
  }();
  return ready;
}

BioPtr bytes_of(std::string_view text) {
  return BioPtr(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
}

/// Never asks on the terminal: the run may be somewhere where nobody sits.
int give_passphrase(char* buffer, int size, int /*writing*/, void* passphrase) {
  const auto& text = *static_cast<const std::string*>(passphrase);
  if (text.empty() || text.size() > static_cast<std::size_t>(size)) return -1;
  text.copy(buffer, text.size());
  return static_cast<int>(text.size());
}

KeyPtr private_key(const std::string& pem, const std::string& passphrase) {
  std::string copy = passphrase;
  KeyPtr key(PEM_read_bio_PrivateKey(bytes_of(pem).get(), nullptr, give_passphrase, &copy));
  ERR_clear_error();
  return key;
}

std::vector<X509Ptr> certificates(const std::string& pem) {
  std::vector<X509Ptr> list;
  const BioPtr bio = bytes_of(pem);
  while (X509* one = PEM_read_bio_X509(bio.get(), nullptr, nullptr, nullptr))
    list.emplace_back(one);
  ERR_clear_error();
  return list;
}

std::string der_of(const X509& certificate) {
  unsigned char* bytes = nullptr;
  const int size = i2d_X509(&certificate, &bytes);
  std::string text;
  if (size > 0) text.assign(reinterpret_cast<const char*>(bytes), static_cast<std::size_t>(size));
  OPENSSL_free(bytes);
  return text;
}

std::string contents(BIO* bio) {
  const char* data = nullptr;
  const auto size = BIO_get_mem_data(bio, &data);
  return {data, static_cast<std::size_t>(size)};
}

std::string subject_of(const X509& certificate) {
  const BioPtr bio(BIO_new(BIO_s_mem()));
  // Letters beyond ASCII as they are, not as \D0\9B.
  X509_NAME_print_ex(bio.get(), X509_get_subject_name(&certificate), 0,
                     XN_FLAG_RFC2253 & ~static_cast<unsigned long>(ASN1_STRFLGS_ESC_MSB));
  return clean_text(contents(bio.get()));
}

std::string day_of(const ASN1_TIME* time) {
  std::tm parts{};
  if (ASN1_TIME_to_tm(time, &parts) != 1) return "?";
  return fmt::format("{:04}-{:02}-{:02}", parts.tm_year + 1900, parts.tm_mon + 1, parts.tm_mday);
}

bool is_allowed(const EVP_PKEY& key) {
  const int type = EVP_PKEY_get_base_id(&key);
  return type == EVP_PKEY_EC || (type == EVP_PKEY_RSA && EVP_PKEY_get_bits(&key) >= kLeastRsaBits);
}

/// A context that signs and verifies with this key only, and with these algorithms only.
SignatureContextPtr context_for(KeyPtr key) {
  SignatureContextPtr context(xmlSecDSigCtxCreate(nullptr));
  if (!context) return nullptr;
  for (const xmlSecTransformId id : {xmlSecTransformRsaSha256Id, xmlSecTransformEcdsaSha256Id,
                                     xmlSecTransformExclC14NId, xmlSecTransformSha256Id}) {
    xmlSecDSigCtxEnableSignatureTransform(context.get(), id);
  }
  for (const xmlSecTransformId id :
       {xmlSecTransformEnvelopedId, xmlSecTransformExclC14NId, xmlSecTransformSha256Id}) {
    xmlSecDSigCtxEnableReferenceTransform(context.get(), id);
  }
  xmlSecKeyDataPtr value = xmlSecOpenSSLEvpKeyAdopt(key.get());
  if (value == nullptr) return nullptr;
  key.release();  // NOLINT(bugprone-unused-return-value): it is the value's now
  context->signKey = xmlSecKeyCreate();
  if (context->signKey == nullptr || xmlSecKeySetValue(context->signKey, value) < 0) {
    xmlSecKeyDataDestroy(value);
    return nullptr;
  }
  return context;
}

XmlDocPtr parsed(std::string_view xml) {
  return XmlDocPtr(xmlReadMemory(xml.data(), static_cast<int>(xml.size()), "certificate.xml",
                                 nullptr,
                                 XML_PARSE_NONET | XML_PARSE_NOERROR | XML_PARSE_NOWARNING));
}

std::string base64(const std::string& bytes) {
  std::string text(4 * ((bytes.size() + 2) / 3) + 1, '\0');
  const int size = EVP_EncodeBlock(reinterpret_cast<unsigned char*>(text.data()),
                                   reinterpret_cast<const unsigned char*>(bytes.data()),
                                   static_cast<int>(bytes.size()));
  text.resize(static_cast<std::size_t>(size));
  std::string lines;
  for (std::size_t at = 0; at < text.size(); at += 64) {
    lines.append(at == 0 ? 0 : 1, '\n').append(text, at, 64);
  }
  return lines;
}

X509Ptr certificate_from(const xmlNode& node) {
  const std::unique_ptr<xmlChar, void (*)(void*)> text(xmlNodeGetContent(&node), xmlFree);
  std::string packed;
  for (const xmlChar* c = text.get(); c != nullptr && *c != 0; ++c) {
    if (*c > 0x20) packed += static_cast<char>(*c);
  }
  std::string der(packed.size(), '\0');
  int size = EVP_DecodeBlock(reinterpret_cast<unsigned char*>(der.data()),
                             reinterpret_cast<const unsigned char*>(packed.data()),
                             static_cast<int>(packed.size()));
  if (size <= 0) return nullptr;
  // The padding counts as zeros here; DER knows its own length.
  const auto* begin = reinterpret_cast<const unsigned char*>(der.data());
  X509Ptr certificate(d2i_X509(nullptr, &begin, size));
  ERR_clear_error();
  return certificate;
}

std::vector<xmlNode*> all_signatures(xmlNode* node) {
  std::vector<xmlNode*> found;
  for (; node != nullptr; node = node->next) {
    if (node->type != XML_ELEMENT_NODE) continue;
    if (xmlSecCheckNodeName(node, xmlSecNodeSignature, xmlSecDSigNs)) found.push_back(node);
    for (xmlNode* below : all_signatures(node->children)) found.push_back(below);
  }
  return found;
}

xmlNode* child(xmlNode* node, const xmlChar* name) {
  return node == nullptr ? nullptr : xmlSecFindChild(node, name, xmlSecDSigNs);
}

std::string algorithm_of(xmlNode& node) {
  const std::unique_ptr<xmlChar, void (*)(void*)> text(xmlGetNoNsProp(&node, xmlSecAttrAlgorithm),
                                                       xmlFree);
  return text ? reinterpret_cast<const char*>(text.get()) : "";
}

/// Only what covers the document from its root to its end is a signature of it. Others may hold by
/// themselves and say nothing (signature wrapping).
std::string wrong_scope(const xmlDoc& document, xmlNode& signature) {
  if (document.intSubset != nullptr) return "the document declares types of its own";
  if (signature.parent != xmlDocGetRootElement(&document)) return "it is not the document's own";
  xmlNode* reference = child(child(&signature, xmlSecNodeSignedInfo), xmlSecNodeReference);
  if (reference == nullptr || child(&signature, xmlSecNodeObject) != nullptr) {
    return "it does not refer to the document";
  }
  for (xmlNode* next = xmlSecGetNextElementNode(reference->next); next != nullptr;
       next = xmlSecGetNextElementNode(next->next)) {
    return "it refers to several things";
  }
  const std::unique_ptr<xmlChar, void (*)(void*)> uri(xmlGetNoNsProp(reference, xmlSecAttrURI),
                                                      xmlFree);
  if (!uri || *uri != 0) return "it refers to a part of the document";
  std::vector<std::string> transforms;
  if (xmlNode* list = child(reference, xmlSecNodeTransforms)) {
    for (xmlNode* one = xmlSecGetNextElementNode(list->children); one != nullptr;
         one = xmlSecGetNextElementNode(one->next)) {
      transforms.push_back(algorithm_of(*one));
    }
  }
  const auto href = [](const xmlChar* text) {
    return std::string(reinterpret_cast<const char*>(text));
  };
  if (transforms != std::vector<std::string>{href(xmlSecHrefEnveloped), href(xmlSecHrefExcC14N)}) {
    return "it signs something made from the document, not the document";
  }
  return "";
}

std::string wrong_with(xmlDoc& document, xmlNode& signature, const X509& certificate) {
  if (std::string scope = wrong_scope(document, signature); !scope.empty()) return scope;
  KeyPtr key(X509_get_pubkey(const_cast<X509*>(&certificate)));
  if (!key || !is_allowed(*key)) return "the key is none that counts (RSA from 2048 bits, ECDSA)";
  const SignatureContextPtr context = context_for(std::move(key));
  if (!context) return "the key cannot be used";
  if (xmlSecDSigCtxVerify(context.get(), &signature) < 0) return "it cannot be read";
  return context->status == xmlSecDSigStatusSucceeded
             ? ""
             : "the document was changed after it was signed, or another key signed it";
}

bool is_issued_by(const X509& certificate, const std::vector<X509Ptr>& trusted) {
  const StorePtr store(X509_STORE_new());
  for (const X509Ptr& one : trusted) X509_STORE_add_cert(store.get(), one.get());
  const StoreContextPtr context(X509_STORE_CTX_new());
  if (X509_STORE_CTX_init(context.get(), store.get(), const_cast<X509*>(&certificate), nullptr) !=
      1) {
    return false;
  }
  X509_VERIFY_PARAM_set_flags(X509_STORE_CTX_get0_param(context.get()),
                              X509_V_FLAG_PARTIAL_CHAIN | X509_V_FLAG_NO_CHECK_TIME);
  const bool good = X509_verify_cert(context.get()) == 1;
  ERR_clear_error();
  return good;
}

constexpr std::string_view kBegin = "<ds:Signature ";
constexpr std::string_view kEnd = "</ds:Signature>";

}  // namespace

Result<SigningKey> read_signing_key(const std::filesystem::path& key,
                                    const std::filesystem::path& certificate,
                                    const std::string& passphrase) {
  auto key_pem = read_file(key);
  if (!key_pem) return fail(key_pem.error());
  auto certificate_pem = read_file(certificate);
  if (!certificate_pem) return fail(certificate_pem.error());
  const auto refuse = [](const std::filesystem::path& file, const std::string& why) {
    return fail(ErrorCode::input, file.string() + ": " + why);
  };
  const KeyPtr secret = private_key(*key_pem, passphrase);
  if (!secret) {
    return refuse(key,
                  "not a private key in PEM, or its passphrase (environment variable "
                  "PLUMBLINE_KEY_PASSPHRASE) is another one");
  }
  if (!is_allowed(*secret)) return refuse(key, "signing takes RSA from 2048 bits, or ECDSA");
  const auto list = certificates(*certificate_pem);
  if (list.empty()) return refuse(certificate, "not an X.509 certificate in PEM");
  const X509& own = *list.front();
  if (X509_check_private_key(&own, secret.get()) != 1) {
    ERR_clear_error();
    return refuse(certificate, "belongs to another key than " + key.string());
  }
  if (X509_cmp_current_time(X509_get0_notAfter(&own)) < 0) {
    return refuse(certificate, "has expired on " + day_of(X509_get0_notAfter(&own)));
  }
  return SigningKey{.key_pem = *std::move(key_pem),
                    .passphrase = passphrase,
                    .certificate_pem = *std::move(certificate_pem),
                    .subject = subject_of(own),
                    .certificate_sha256 = sha256(der_of(own))};
}

Result<std::string> sign_dcc(std::string_view xml, const SigningKey& key) {
  const auto failed = [](const char* what) {
    return fail(ErrorCode::internal, fmt::format("certificate.xml: cannot be signed: {}", what));
  };
  if (!library_ready()) return failed("xmlsec cannot be started");
  KeyPtr secret = private_key(key.key_pem, key.passphrase);
  const auto list = certificates(key.certificate_pem);
  const XmlDocPtr document = parsed(xml);
  if (!secret || list.empty() || !document) return failed("key, certificate or text is unusable");
  const xmlSecTransformId algorithm = EVP_PKEY_get_base_id(secret.get()) == EVP_PKEY_EC
                                          ? xmlSecTransformEcdsaSha256Id
                                          : xmlSecTransformRsaSha256Id;
  xmlNode* signature = xmlSecTmplSignatureCreateNsPref(document.get(), xmlSecTransformExclC14NId,
                                                       algorithm, nullptr, chars("ds"));
  if (signature == nullptr) return failed("no template");
  xmlAddChild(xmlDocGetRootElement(document.get()), signature);
  xmlNode* reference = xmlSecTmplSignatureAddReference(signature, xmlSecTransformSha256Id, nullptr,
                                                       chars(""), nullptr);
  if (reference == nullptr ||
      xmlSecTmplReferenceAddTransform(reference, xmlSecTransformEnvelopedId) == nullptr ||
      xmlSecTmplReferenceAddTransform(reference, xmlSecTransformExclC14NId) == nullptr) {
    return failed("no reference");
  }
  const SignatureContextPtr context = context_for(std::move(secret));
  if (!context || xmlSecDSigCtxSign(context.get(), signature) < 0) return failed("signing failed");
  // Whose key it is; not part of what is signed, but tied to it by the key.
  xmlNode* info = xmlNewChild(signature, signature->ns, xmlSecNodeKeyInfo, nullptr);
  xmlNode* data = xmlNewChild(info, signature->ns, xmlSecNodeX509Data, nullptr);
  xmlNewChild(data, signature->ns, xmlSecNodeX509Certificate,
              chars(base64(der_of(*list.front())).c_str()));

  const std::unique_ptr<xmlBuffer, void (*)(xmlBuffer*)> text(xmlBufferCreate(), xmlBufferFree);
  xmlNodeDump(text.get(), document.get(), signature, 0, 0);
  const std::size_t end = xml.rfind("</");
  // Nothing else is added: a line end would be part of what was signed.
  return fmt::format("{}{}{}", xml.substr(0, end),
                     reinterpret_cast<const char*>(xmlBufferContent(text.get())), xml.substr(end));
}

std::string without_signature(std::string_view xml) {
  std::string text(xml);
  const std::size_t begin = text.rfind(kBegin);
  if (begin == std::string::npos) return text;
  const std::size_t end = text.find(kEnd, begin);
  if (end == std::string::npos) return text;
  return text.erase(begin, end + kEnd.size() - begin);
}

Result<SignatureFound> check_signature(std::string_view xml, const std::string& trusted_pem) {
  const auto trusted = certificates(trusted_pem);
  if (trusted.empty() && !trusted_pem.empty()) {
    return fail(ErrorCode::input, "holds no X.509 certificate in PEM");
  }
  SignatureFound found;
  const XmlDocPtr document = parsed(xml);
  if (!document || !library_ready()) return fail(ErrorCode::internal, "xmlsec cannot be used");
  const auto signatures = all_signatures(xmlDocGetRootElement(document.get()));
  if (signatures.empty()) return found;
  found.present = true;
  if (signatures.size() > 1) {
    found.wrong = "there are several";
    return found;
  }
  xmlNode* data = child(child(signatures.front(), xmlSecNodeKeyInfo), xmlSecNodeX509Data);
  xmlNode* node = child(data, xmlSecNodeX509Certificate);
  const X509Ptr certificate = node == nullptr ? nullptr : certificate_from(*node);
  if (!certificate) {
    found.wrong = "it does not say whose key it is";
    return found;
  }
  found.subject = subject_of(*certificate);
  found.certificate_sha256 = sha256(der_of(*certificate));
  found.valid = fmt::format("{} to {}", day_of(X509_get0_notBefore(certificate.get())),
                            day_of(X509_get0_notAfter(certificate.get())));
  found.wrong = wrong_with(*document, *signatures.front(), *certificate);
  if (!trusted.empty()) found.trusted = is_issued_by(*certificate, trusted);
  return found;
}

}  // namespace plumbline::app
