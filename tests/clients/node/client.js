// Inserts pegs over OPC UA with node-opcua; in the middle of one run it loses its session, and finds the result with the next.
// node client.js URL PEGS LOST CERTIFICATE KEY FOLDER prints `triggered N done N`; LOST is the peg of the lost session, 0 for none.
"use strict";
const {
  AttributeIds, DataType, MessageSecurityMode, OPCUAClient, SecurityPolicy, StatusCodes, Variant, VariantArrayType,
} = require("node-opcua-client");
const { OPCUACertificateManager } = require("node-opcua-certificate-manager");

const [url, pegs, lost, certificateFile, privateKeyFile, rootFolder] = process.argv.slice(2);
const INSERT_PEG = 100, SUCCESS = 1, RESET = 1, IDLE = 4;
const pause = (ms) => new Promise((done) => setTimeout(done, ms));
const word = (value) => new Variant({ dataType: DataType.UInt16, value });

class Cell {
  async connect() {
    const store = new OPCUACertificateManager({ rootFolder, automaticallyAcceptUnknownCertificate: true });
    this.client = OPCUAClient.create({
      applicationUri: "urn:test:plc", certificateFile, privateKeyFile, clientCertificateManager: store,
      securityMode: MessageSecurityMode.SignAndEncrypt, securityPolicy: SecurityPolicy.Basic256Sha256,
      endpointMustExist: false, connectionStrategy: { maxRetry: 0 },
    });
    await this.client.connect(url);
    this.session = await this.client.createSession();
    this.index = (await this.session.readNamespaceArray()).indexOf("urn:tactile-insertion-cell");
    const names = await this.session.read({ nodeId: this.id("Answer.OutputArguments"), attributeId: AttributeIds.Value });
    this.names = names.value.value.map((each) => each.name);
  }

  id(path) {
    return `ns=${this.index};s=Cell${path ? "." + path : ""}`;
  }

  async call(method, ...inputArguments) {
    const found = await this.session.call({ objectId: this.id(""), methodId: this.id(method), inputArguments });
    if (found.statusCode !== StatusCodes.Good) throw new Error(`${method}: ${found.statusCode}`);
    return found.outputArguments.map((each) => each.value);
  }

  async command(number, code) {
    const none = new Variant({ dataType: DataType.Double, arrayType: VariantArrayType.Array, value: [] });
    const serial = new Variant({ dataType: DataType.String, value: `P-${number}` });
    let [answered, refusal] = await this.call("Command", word(number), word(code), word(0), serial, none);
    while (answered !== number) {
      await pause(20);
      ({ Answered: answered, Refusal: refusal } = await this.answer());
    }
    if (refusal !== 0) throw new Error(`${number} is refused with ${refusal}`);
  }

  async answer() {
    const values = await this.call("Answer");
    return Object.fromEntries(this.names.map((name, place) => [name, values[place]]));
  }

  async result(number) {
    for (;;) {
      const answer = await this.answer();
      if (answer.Sequence === number && answer.Result !== 0) return answer;
      await pause(20);
    }
  }

  async leave() {
    await this.session.close();
    await this.client.disconnect();
  }
}

async function main() {
  let cell = new Cell(), number = 1, done = 0;
  await cell.connect();
  await cell.command(number, 0);
  if ((await cell.answer()).State !== IDLE) {
    await cell.command(++number, RESET);
    while ((await cell.answer()).State !== IDLE) await pause(20);
  }
  for (let peg = 1; peg <= pegs; peg++) {
    await cell.command(++number, INSERT_PEG);
    if (peg === Number(lost)) {
      await cell.leave();
      cell = new Cell();
      await cell.connect();
      await cell.command(number, INSERT_PEG); // the run's own number: it does not run again
    }
    const { Result } = await cell.result(number);
    done += Result === SUCCESS;
    await cell.call("Acknowledge", word(number));
    while ((await cell.answer()).State !== IDLE) await pause(20);
  }
  await cell.leave();
  console.log(`triggered ${pegs} done ${done}`);
}

main().catch((error) => { console.error(error); process.exit(1); });
