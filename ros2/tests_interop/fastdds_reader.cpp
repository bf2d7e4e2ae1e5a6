// Reads slipbound_msgs/SlipReport with FastDDS and prints each as a line of JSON, NaN as null: fastdds_reader DOMAIN TOPIC COUNT.
// The type is written by hand as fastddsgen would: members in the order of SlipReport.msg.
#include <fastcdr/Cdr.h>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>

#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <thread>

using namespace eprosima::fastdds::dds;
using eprosima::fastcdr::Cdr;
using eprosima::fastcdr::FastBuffer;

// Writes the next member of the message as JSON.
struct Printer {
    Cdr& cdr;
    std::string out;
    bool first = true;

    void key(const char* name) {
        out += std::string(first ? "" : ",") + "\"" + name + "\":";
        first = false;
    }
    void value(double number) {
        char text[40];
        std::snprintf(text, sizeof text, "%.17g", number);
        out += std::isnan(number) ? "null" : text;
    }
    void f64(const char* name) { double v; cdr >> v; key(name); value(v); }
    void u32(const char* name) { uint32_t v; cdr >> v; key(name); out += std::to_string(v); }
    void i32(const char* name) { int32_t v; cdr >> v; key(name); out += std::to_string(v); }
    void u64(const char* name) { uint64_t v; cdr >> v; key(name); out += std::to_string(v); }
    void flag(const char* name) { bool v; cdr >> v; key(name); out += v ? "true" : "false"; }
    void text(const char* name) { std::string v; cdr >> v; key(name); out += "\"" + v + "\""; }
    void point(const char* name) {
        double x, y;
        cdr >> x >> y;
        key(name);
        out += "[";
        value(x);
        out += ",";
        value(y);
        out += "]";
    }
    void open(const char* name) { key(name); out += "{"; first = true; }
    void close() { out += "}"; first = false; }
    void estimate(const char* name) { open(name); f64("value"); f64("sd"); u32("age_frames"); close(); }
};

static std::string report(Cdr& cdr) {
    Printer p{cdr, "{"};
    p.open("header"); p.open("stamp"); p.i32("sec"); p.u32("nanosec"); p.close(); p.text("frame_id"); p.close();
    p.text("finger"); p.u64("frame"); p.u64("seq"); p.u64("time_ns"); p.text("state"); p.text("reason");
    p.open("contact"); p.f64("area_px2"); p.f64("area_mm2"); p.f64("quality"); p.close();
    p.open("markers"); p.u32("detected"); p.u32("matched"); p.u32("lost"); p.u32("inner"); p.close();
    p.u64("reference_seq"); p.f64("grip_n");
    p.open("motion"); p.point("reference_px"); p.point("translation_px"); p.point("translation_mm");
    p.f64("rotation_rad"); p.point("icr_px"); p.close();
    p.open("shear"); p.point("translation_px"); p.point("translation_mm"); p.f64("rotation_rad"); p.close();
    p.open("slip"); p.u32("markers_over"); p.u32("markers_needed"); p.f64("threshold_pitch"); p.f64("max_pitch");
    p.f64("max_mm"); p.text("kind"); p.f64("direction_rad"); p.close();
    for (const char* name : {"stick_ratio", "margin", "shear_n", "torque_nmm", "friction"}) p.estimate(name);
    p.open("evidence"); p.u64("reference_seq"); p.f64("relaxation"); p.f64("centre_rim_ratio"); p.f64("imprint_change");
    p.u32("imprint_age_frames"); p.f64("slide_score"); p.point("slide_px"); p.f64("slide_rad"); p.flag("slides");
    p.f64("gross_probability"); p.f64("slide_pitch_per_s"); p.f64("slide_mm_per_s"); p.close();
    return p.out + "}";
}

class SlipReportType : public TopicDataType {
public:
    SlipReportType() {
        setName("slipbound_msgs::msg::dds_::SlipReport_");
        m_typeSize = 4096;
        m_isGetKeyDefined = false;
    }
    bool serialize(void*, eprosima::fastrtps::rtps::SerializedPayload_t*) override { return false; }
    bool deserialize(eprosima::fastrtps::rtps::SerializedPayload_t* payload, void* data) override {
        try {
            FastBuffer buffer(reinterpret_cast<char*>(payload->data), payload->length);
            Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
            cdr.read_encapsulation();
            *static_cast<std::string*>(data) = report(cdr);
            return true;
        } catch (const eprosima::fastcdr::exception::Exception& e) {
            std::fprintf(stderr, "not a SlipReport: %s\n", e.what());
            return false;
        }
    }
    std::function<uint32_t()> getSerializedSizeProvider(void*) override { return [] { return 4096u; }; }
    void* createData() override { return new std::string; }
    void deleteData(void* data) override { delete static_cast<std::string*>(data); }
    bool getKey(void*, eprosima::fastrtps::rtps::InstanceHandle_t*, bool) override { return false; }
};

class Listener : public DataReaderListener {
public:
    std::atomic<long> count{0};
    void on_subscription_matched(DataReader*, const SubscriptionMatchedStatus& status) override {
        std::fprintf(stderr, "matched %d\n", status.current_count);
    }
    void on_data_available(DataReader* reader) override {
        std::string line;
        SampleInfo info;
        while (reader->take_next_sample(&line, &info) == ReturnCode_t::RETCODE_OK) {
            if (!info.valid_data) continue;
            std::puts(line.c_str());
            std::fflush(stdout);
            ++count;
        }
    }
};

int main(int argc, char** argv) {
    if (argc != 4) {
        std::fprintf(stderr, "expected DOMAIN TOPIC COUNT\n");
        return 2;
    }
    auto* factory = DomainParticipantFactory::get_instance();
    auto* participant = factory->create_participant(std::atoi(argv[1]), PARTICIPANT_QOS_DEFAULT);
    TypeSupport type(new SlipReportType);
    type.register_type(participant);
    auto* topic = participant->create_topic(std::string("rt/") + argv[2], type.get_type_name(), TOPIC_QOS_DEFAULT);
    auto* subscriber = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
    DataReaderQos qos = DATAREADER_QOS_DEFAULT;
    qos.reliability().kind = RELIABLE_RELIABILITY_QOS;
    qos.history().kind = KEEP_LAST_HISTORY_QOS;
    qos.history().depth = 100;
    Listener listener;
    if (!subscriber->create_datareader(topic, qos, &listener)) return 1;
    while (listener.count < std::atol(argv[3])) std::this_thread::sleep_for(std::chrono::milliseconds(10));
    return 0;
}
