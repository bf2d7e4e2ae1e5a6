// Asks a service with FastDDS as rmw_fastrtps_cpp does: the request's identity travels in the inline QoS ("enhanced"). The request
// has one byte, as every request without fields. Prints the answer as its bytes in hexadecimal: fastdds_client DOMAIN SERVICE TYPE.
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <fastdds/rtps/common/WriteParams.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <thread>

using namespace eprosima::fastdds::dds;
using eprosima::fastrtps::rtps::SampleIdentity;
using eprosima::fastrtps::rtps::SerializedPayload_t;
using eprosima::fastrtps::rtps::WriteParams;

// A message as the bytes that are on the wire, with the four that say how it is encoded.
struct Bytes : TopicDataType {
    explicit Bytes(const std::string& name) {
        setName(name.c_str());
        m_typeSize = 4096;
    }
    bool serialize(void* data, SerializedPayload_t* payload) override {
        auto* bytes = static_cast<std::string*>(data);
        std::memcpy(payload->data, bytes->data(), bytes->size());
        payload->length = bytes->size();
        return true;
    }
    bool deserialize(SerializedPayload_t* payload, void* data) override {
        static_cast<std::string*>(data)->assign(reinterpret_cast<char*>(payload->data), payload->length);
        return true;
    }
    std::function<uint32_t()> getSerializedSizeProvider(void*) override { return [] { return 4096u; }; }
    void* createData() override { return new std::string; }
    void deleteData(void* data) override { delete static_cast<std::string*>(data); }
    bool getKey(void*, eprosima::fastrtps::rtps::InstanceHandle_t*, bool) override { return false; }
};

template <typename Ready>
bool await(Ready ready) {
    auto until = std::chrono::steady_clock::now() + std::chrono::seconds(40);
    while (!ready()) {
        if (std::chrono::steady_clock::now() > until) return false;
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return true;
}

int main(int argc, char** argv) {
    if (argc != 4) {
        std::fprintf(stderr, "expected DOMAIN SERVICE TYPE\n");
        return 2;
    }
    std::string service = argv[2], kind = argv[3];
    auto* participant =
        DomainParticipantFactory::get_instance()->create_participant(std::atoi(argv[1]), PARTICIPANT_QOS_DEFAULT);
    auto topic = [&](const std::string& name, const std::string& type_name) {
        TypeSupport type(new Bytes(type_name));
        type.register_type(participant);
        return participant->create_topic(name, type_name, TOPIC_QOS_DEFAULT);
    };
    DataWriterQos writes = DATAWRITER_QOS_DEFAULT;
    writes.reliability().kind = RELIABLE_RELIABILITY_QOS;
    DataReaderQos reads = DATAREADER_QOS_DEFAULT;
    reads.reliability().kind = RELIABLE_RELIABILITY_QOS;
    auto* writer = participant->create_publisher(PUBLISHER_QOS_DEFAULT)
                       ->create_datawriter(topic("rq/" + service + "Request", kind + "_Request_"), writes);
    auto* reader = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT)
                       ->create_datareader(topic("rr/" + service + "Reply", kind + "_Response_"), reads);
    PublicationMatchedStatus to;
    SubscriptionMatchedStatus from;
    if (!await([&] {
            writer->get_publication_matched_status(to);
            reader->get_subscription_matched_status(from);
            return to.current_count > 0 && from.current_count > 0;
        })) {
        std::fprintf(stderr, "no server\n");
        return 1;
    }
    std::this_thread::sleep_for(std::chrono::seconds(1)); // the other side of the match

    std::string request(std::string("\0\1\0\0\0", 5));
    WriteParams params;
    // The answers are told apart by the reader that is to have them.
    params.related_sample_identity().writer_guid() = reader->guid();
    if (!writer->write(&request, params)) return 1;
    SampleIdentity asked = params.sample_identity();
    std::string answer;
    SampleInfo info;
    if (!await([&] {
            return reader->take_next_sample(&answer, &info) == ReturnCode_t::RETCODE_OK && info.valid_data;
        })) {
        std::fprintf(stderr, "no answer\n");
        return 1;
    }
    auto related = info.related_sample_identity;
    bool is_ours = related.sequence_number() == asked.sequence_number()
        && (related.writer_guid() == asked.writer_guid() || related.writer_guid() == reader->guid());
    if (!is_ours) {
        std::fprintf(stderr, "an answer to somebody else\n");
        return 1;
    }
    for (unsigned char byte : answer) std::printf("%02x", byte);
    std::puts("");
    return 0;
}
